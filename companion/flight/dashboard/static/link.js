// The channel to the companion: newest messages in, orders out, and the knowledge of how old all this is.

const STALE_MS = 2000;
const ANSWER_MS = 5000;
const FIRST_PAUSE_MS = 500;
const LONGEST_PAUSE_MS = 5000;

export class Link {
  /** onMessage is called with every message, onUp when a channel opens. */
  constructor(onMessage, onUp) {
    this._onMessage = onMessage;
    this._onUp = onUp;
    this._pause = FIRST_PAUSE_MS;
    this._waiting = new Map();
    this._next = 1;
    this.heardAt = -Infinity;
    this.tick = 0;
    this._open();
  }

  /** Milliseconds since the last state arrived. */
  get age() {
    return performance.now() - this.heardAt;
  }

  get stale() {
    return this.age > STALE_MS;
  }

  /** Send an order; resolves to {ok, reason}. */
  order(fields) {
    return this._ask(fields);
  }

  _ask(fields) {
    if (this._socket.readyState !== WebSocket.OPEN) {
      return Promise.resolve({ ok: false, reason: "no connection to the companion" });
    }
    const id = this._next++;
    this._socket.send(`${this.tick} ${JSON.stringify({ id, ...fields })}`);
    return new Promise((resolve) => {
      const timer = setTimeout(() => this._settle(id, { ok: false, reason: "no answer" }), ANSWER_MS);
      this._waiting.set(id, { resolve, timer });
    });
  }

  _settle(id, answer) {
    const waiting = this._waiting.get(id);
    if (!waiting) return;
    this._waiting.delete(id);
    clearTimeout(waiting.timer);
    waiting.resolve(answer);
  }

  _open() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = (this._socket = new WebSocket(`${scheme}://${location.host}/live`));
    socket.onopen = () => {
      this._pause = FIRST_PAUSE_MS;
      this.tick = 0; // nothing was seen on this channel yet
      this._onUp();
    };
    socket.onmessage = (event) => this._take(JSON.parse(event.data));
    socket.onclose = () => {
      for (const id of [...this._waiting.keys()]) this._settle(id, { ok: false, reason: "connection lost" });
      setTimeout(() => this._open(), this._pause);
      this._pause = Math.min(2 * this._pause, LONGEST_PAUSE_MS);
    };
  }

  _take(message) {
    if (message.t === "state") {
      this.heardAt = performance.now();
      this.tick = message.tick;
    }
    if (message.t === "reply" || message.t === "facts") this._settle(message.id, message);
    this._onMessage(message);
  }
}
