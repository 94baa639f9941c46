// A button that is held for a second by finger, mouse or key, so that no stray touch begins a landing.

const HOLD_MS = 1000;

export class Hold {
  /** ready() returns what to do once the button was held, given what is shown as the hold begins; onEarly is called when it is let go before. */
  constructor(button, ready, onEarly) {
    Object.assign(this, { _button: button, _ready: ready, _onEarly: onEarly, _filling: null });
    button.addEventListener("pointerdown", (event) => {
      button.releasePointerCapture(event.pointerId); // a finger that slides off lets it go
      if (event.button === 0) this.begin();
    });
    button.addEventListener("keydown", (event) => {
      if (event.key !== "Enter" && event.key !== " ") return;
      event.preventDefault();
      if (!event.repeat) this.begin();
    });
    button.addEventListener("contextmenu", (event) => event.preventDefault()); // a long press of a finger
    for (const end of ["pointerup", "pointercancel", "pointerleave", "blur"]) button.addEventListener(end, () => this.end());
    document.addEventListener("keyup", () => this.end());
    window.addEventListener("blur", () => this.end());
  }

  begin() {
    const act = this._button.disabled || this._filling ? null : this._ready();
    if (!act) return;
    this._filling = this._button.animate({ backgroundSize: ["0 100%", "100% 100%"] }, HOLD_MS);
    this._filling.onfinish = () => {
      this._filling = null;
      if (!this._button.disabled) act();
    };
  }

  end() {
    if (!this._filling) return;
    this._filling.cancel();
    this._filling = null;
    this._onEarly();
  }
}
