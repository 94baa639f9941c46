// The bird's view: the map from above, drawn on a canvas.

import { SHARE } from "./background.js";
import { amount, fitCanvas } from "./dom.js";
import { ahead, MOVING, movingWords, radiusOf } from "./moving.js";
import { middle, pieces, WIRE, wireWords } from "./wires.js";
import { corners, FENCE, fenceWords, isBeyond } from "./fence.js";
import { rampColour } from "./paint.js";
import { drawArrow, drawRose, roseRadius, windWords, WIND } from "./rose.js";
import { holds, pathOf, patternsOf, STATE_STYLE, STYLE, styleOf, surfaceWords } from "./zones.js";

const FRAME_MS = 45;
const [LEAST_SCALE, MOST_SCALE] = [0.15, 60]; // pixels a metre
const TAP_PX = 8;
const FIELD_DEG = 60; // half the field of view that is drawn
const OBSTACLE_LABELS = 12;

export class BirdView {
  /** onPick(east, north, zone) is called for a tap on the map. */
  constructor(canvas, model, sheets, background, onPick) {
    Object.assign(this, { canvas, model, sheets, background, onPick });
    this.centre = [0, 0];
    this.scale = 5;
    this.follow = true;
    this.trackUp = false;
    this.turn = 0;
    this.frames = 0;
    this._fitted = false;
    this._pointers = new Map();
    this._last = 0;
    this._listen();
    const draw = (now) => {
      requestAnimationFrame(draw);
      if (now - this._last < FRAME_MS || canvas.clientWidth === 0) return;
      this._last = now;
      this._draw(now);
      this.frames++;

    };
    requestAnimationFrame(draw);
  }

  // ---- geometry: map to screen and back ------------------------------------------------------

  place = (east, north) => {
    const [x, y] = [(east - this.centre[0]) * this._k, -(north - this.centre[1]) * this._k];
    const [c, s] = [Math.cos(this.turn), Math.sin(this.turn)];
    return [this._w / 2 + c * x - s * y, this._h / 2 + s * x + c * y];
  };

  unplace(x, y) {
    const [dx, dy] = [x - this._w / 2, y - this._h / 2];
    const [c, s] = [Math.cos(-this.turn), Math.sin(-this.turn)];
    return [this.centre[0] + (c * dx - s * dy) / this._k, this.centre[1] - (s * dx + c * dy) / this._k];
  }

  zoom(factor, x = this._w / 2, y = this._h / 2) {
    const [east, north] = this.unplace(x, y);
    this.scale = Math.min(MOST_SCALE, Math.max(LEAST_SCALE, this.scale * factor));
    this._k = this.scale * this._ratio;
    const [e, n] = this.unplace(x, y);
    if (!this.follow) this.centre = [this.centre[0] + east - e, this.centre[1] + north - n];
  }

  pan(dx, dy) {
    this.follow = false;
    const [c, s] = [Math.cos(-this.turn), Math.sin(-this.turn)];
    this.centre = [this.centre[0] - (c * dx - s * dy) / this._k, this.centre[1] + (s * dx + c * dy) / this._k];
  }

  /** Show all zones and the vehicle. */
  fit() {
    const points = this.model.allZones().flatMap((zone) => zone.rings.flat().map((ring) => ring));
    let [west, south, east, north] = [Infinity, Infinity, -Infinity, -Infinity];
    const add = (e, n) => {
      [west, east] = [Math.min(west, e), Math.max(east, e)];
      [south, north] = [Math.min(south, n), Math.max(north, n)];
    };
    for (const ring of points) for (let i = 0; i < ring.length; i += 2) add(ring[i] / 100, ring[i + 1] / 100);
    const pose = this.model.pose();
    if (pose) add(pose.east, pose.north);
    if (!Number.isFinite(west)) return false;
    this.follow = false;
    this.centre = [(west + east) / 2, (south + north) / 2];
    const [w, h] = [this.canvas.clientWidth, this.canvas.clientHeight];
    this.scale = Math.min(12, Math.max(LEAST_SCALE, 0.86 * Math.min(w / (east - west + 10), h / (north - south + 10))));
    return true;
  }

  // ---- input -----------------------------------------------------------------------------------

  _listen() {
    const canvas = this.canvas;
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY * 0.0015), event.offsetX * this._ratio, event.offsetY * this._ratio);
    }, { passive: false });
    canvas.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      canvas.setPointerCapture(event.pointerId);
      this._pointers.set(event.pointerId, { x: event.offsetX, y: event.offsetY, x0: event.offsetX, y0: event.offsetY });
      if (this._pointers.size > 1) this._pinched = true;
    });
    canvas.addEventListener("pointermove", (event) => this._move(event));
    canvas.addEventListener("pointerup", (event) => this._up(event));
    canvas.addEventListener("pointercancel", (event) => {
      this._pointers.delete(event.pointerId);
      if (!this._pointers.size) this._pinched = false;
    });
    canvas.addEventListener("keydown", (event) => this._key(event));
  }

  _move(event) {
    const pointer = this._pointers.get(event.pointerId);
    if (!pointer) return;
    const before = [...this._pointers.values()].map(({ x, y }) => [x, y]);
    const [dx, dy] = [event.offsetX - pointer.x, event.offsetY - pointer.y];
    [pointer.x, pointer.y] = [event.offsetX, event.offsetY];
    if (this._pointers.size === 1) {
      const far = Math.hypot(event.offsetX - pointer.x0, event.offsetY - pointer.y0) > TAP_PX;
      if (far || pointer.moved) {
        pointer.moved = true;
        this.pan(dx * this._ratio, dy * this._ratio);
      }
      return;
    }
    const after = [...this._pointers.values()].map(({ x, y }) => [x, y]);
    const span = ([a, b]) => Math.hypot(a[0] - b[0], a[1] - b[1]);
    const middle = ([a, b]) => [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
    const [m0, m1] = [middle(before), middle(after)];
    this.pan((m1[0] - m0[0]) * this._ratio, (m1[1] - m0[1]) * this._ratio);
    this.zoom(span(after) / Math.max(1, span(before)), m1[0] * this._ratio, m1[1] * this._ratio);
  }

  _up(event) {
    const pointer = this._pointers.get(event.pointerId);
    this._pointers.delete(event.pointerId);
    const tapped = pointer && !pointer.moved && !this._pinched;
    if (!this._pointers.size) this._pinched = false;
    if (tapped) this._pick(event.offsetX * this._ratio, event.offsetY * this._ratio);
  }

  _pick(x, y) {
    const [east, north] = this.unplace(x, y);
    const zone = this.model.near().find((z) => holds(z, east, north)) ?? this.model.far().find((z) => holds(z, east, north));
    this.onPick(east, north, zone ?? null);
  }

  _key(event) {
    const step = 60 * this._ratio;
    const moves = { ArrowLeft: [step, 0], ArrowRight: [-step, 0], ArrowUp: [0, step], ArrowDown: [0, -step] };
    if (moves[event.key]) this.pan(...moves[event.key]);
    else if (event.key === "+" || event.key === "=") this.zoom(1.25);
    else if (event.key === "-") this.zoom(0.8);
    else if (event.key === "Enter") this._pick(this._w / 2, this._h / 2);
    else return;
    event.preventDefault();
  }

  // ---- drawing ---------------------------------------------------------------------------------

  _draw(now) {
    const { width, height, ratio } = fitCanvas(this.canvas);
    [this._w, this._h, this._ratio] = [width, height, ratio];
    const pose = this.model.pose(now);
    if (!this._fitted && this.model.near().length) this._fitted = this.fit();
    if (this.follow && pose) this.centre = [pose.east, pose.north];
    this.turn = this.trackUp && pose ? -(pose.yaw * Math.PI) / 180 : 0;
    this._k = this.scale * ratio;
    const pen = this.canvas.getContext("2d");
    pen.setTransform(1, 0, 0, 1, 0, 0);
    this._unseen(pen);
    this._picture(pen);
    this._ground(pen);
    this._zones(pen);
    this._obstacles(pen);
    this._path(pen);
    this._way(pen, pose);
    this._selected(pen);
    this._fence(pen);
    this._wires(pen);
    this._moving(pen);
    this._cursor(pen);
    if (pose) this._vehicle(pen, pose);
    this._names(pen);
    this._furniture(pen);
  }

  _unseen(pen) {
    pen.fillStyle = "#14181d";
    pen.fillRect(0, 0, this._w, this._h);
  }

  /** West, south, east and north of what is in view, and metres a pixel. */
  _view() {
    const reach = Math.hypot(this._w, this._h) / 2 / this._k;
    const [e, n] = this.centre;
    const half = this.turn ? [reach, reach] : [this._w / 2 / this._k, this._h / 2 / this._k];
    return [e - half[0], n - half[1], e + half[0], n + half[1], 1 / this._k];
  }

  /** Draw a picture of square cells whose north-western corner is known. */
  _lay(pen, picture, west, north, cell) {
    const [c, s] = [Math.cos(this.turn) * this._k * cell, Math.sin(this.turn) * this._k * cell];
    pen.setTransform(c, s, -s, c, ...this.place(west, north));
    pen.imageSmoothingEnabled = this._k * cell < 3;
    pen.drawImage(picture, 0, 0);
    pen.setTransform(1, 0, 0, 1, 0, 0);
  }

  /** The background picture, faint: most of what is unseen lies over it. */
  _picture(pen) {
    for (const tile of this.background.view(...this._view())) this._lay(pen, ...tile);
    pen.globalAlpha = 1 - SHARE;
    this._unseen(pen);
    pen.globalAlpha = 1;
  }

  _ground(pen) {
    for (const block of this.sheets.view(...this._view())) {
      const { data } = block;
      pen.globalAlpha = block.sheet === "far" ? 0.72 : 1;
      this._lay(pen, this.sheets.picture(block), data.west, data.south + data.side * data.cell, data.cell);
    }
    pen.globalAlpha = 1;
  }

  _zones(pen) {
    const r = this._ratio;
    this._surveyed(pen);
    for (const [zones, far] of [[this.model.far(), true], [this.model.near(), false]]) {
      for (const zone of zones) {
        const path = pathOf(zone, this.place);
        const style = styleOf(zone);
        const chosen = this.model.picked?.zone?.id === zone.id;
        pen.globalAlpha = far ? 0.55 : 1;
        pen.fillStyle = style.fill;
        pen.fill(path, "evenodd");
        for (const pattern of patternsOf(pen, zone)) {
          pattern.setTransform(new DOMMatrix().scale(r));
          pen.fillStyle = pattern;
          pen.fill(path, "evenodd");
        }
        pen.globalAlpha = 1;
        pen.setLineDash(far ? [7 * r, 5 * r] : []);
        pen.lineWidth = (chosen ? 5.5 : 3.5) * r;
        pen.strokeStyle = chosen ? "#ffffff" : style.halo;
        pen.globalAlpha = chosen ? 1 : 0.55;
        pen.stroke(path);
        pen.globalAlpha = 1;
        pen.lineWidth = 1.8 * r;
        pen.strokeStyle = style.line;
        pen.stroke(path);
        pen.setLineDash([]);
      }
    }
  }

  /** What a survey before the flight found: grey and dotted, below all that was seen since. */
  _surveyed(pen) {
    const r = this._ratio;
    for (const zone of this.model.prior()) {
      const path = pathOf(zone, this.place);
      pen.fillStyle = STYLE.prior.fill;
      pen.fill(path, "evenodd");
      pen.setLineDash([2 * r, 4 * r]);
      pen.lineWidth = 2 * r;
      pen.strokeStyle = STYLE.prior.line;
      pen.stroke(path);
      pen.setLineDash([]);
    }
  }

  _names(pen) {
    const r = this._ratio;
    const taken = [];
    const point = this.model.selected();
    if (point) {
      const [x, y] = this.place(point.enu_m[0], point.enu_m[1]);
      const far = point.rose ? roseRadius(r) : 28 * r;
      taken.push([x - 84 * r, y + far + 2 * r, x + 84 * r, y + far + 26 * r]); // what is said of the point comes first
      if (point.rose) taken.push([x - far, y - far, x + far, y + far]);
    }
    const zones = [...this.model.near().map((z) => [z, ""]), ...this.model.far().map((z) => [z, " far"])];
    for (const [zone, suffix] of zones) {
      const [x, y] = this.place(zone.best[0], zone.best[1]);
      if (x < 0 || y < 0 || x > this._w || y > this._h) continue;
      if (zone.area_m2 * this._k * this._k < 900 * r * r && zone.rank > 4) continue;
      const box = [x - 46 * r, y - (surfaceWords(zone) ? 48 : 34) * r, x + 46 * r, y - 2 * r];
      if (taken.some((t) => box[0] < t[2] && box[2] > t[0] && box[1] < t[3] && box[3] > t[1])) continue;
      taken.push(box);
      pen.fillStyle = styleOf(zone).line;
      pen.strokeStyle = "#0b0e12";
      pen.lineWidth = 1 * r;
      pen.beginPath();
      pen.arc(x, y, 3.2 * r, 0, 7);
      pen.fill();
      pen.stroke();
      const surface = surfaceWords(zone);
      this._plate(pen, x, y - 8 * r, [
        `${zone.id}${suffix} · ${Math.round(zone.area_m2)} m²`,
        this.model.sureWords(zone),
        ...(surface ? [surface] : []),
        ...(isBeyond(this.model, zone) ? ["beyond the fence"] : []),
      ]);
    }
  }

  /** Lines of text on a dark plate above a point. */
  _plate(pen, x, y, lines, colour = "#f2f5f7") {
    const r = this._ratio;
    pen.font = `600 ${11.5 * r}px system-ui, sans-serif`;
    pen.textAlign = "center";
    pen.textBaseline = "bottom";
    const width = Math.max(...lines.map((line) => pen.measureText(line).width)) + 10 * r;
    const high = lines.length * 14 * r + 4 * r;
    pen.fillStyle = "rgba(10, 13, 17, 0.78)";
    pen.beginPath();
    pen.roundRect(x - width / 2, y - high, width, high, 4 * r);
    pen.fill();
    lines.forEach((line, i) => {
      pen.font = `${i ? 400 : 600} ${(i ? 10.5 : 11.5) * r}px system-ui, sans-serif`;
      pen.fillStyle = i ? "#c3ccd4" : colour;
      pen.fillText(line, x, y - high + (i + 1) * 14 * r + 1 * r);
    });
  }

  /** The autopilot's fence: dashes, and in words which side of them is forbidden. */
  _fence(pen) {
    const r = this._ratio;
    for (const boundary of this.model.state?.fence?.boundaries ?? []) {
      const places = corners(boundary).map(([e, n]) => this.place(e, n));
      for (const [colour, width] of [[FENCE.halo, 5 * r], [FENCE.line, 2.4 * r]]) {
        pen.strokeStyle = colour;
        pen.lineWidth = width;
        pen.setLineDash([12 * r, 5 * r]);
        pen.beginPath();
        for (const place of places) pen.lineTo(...place);
        pen.closePath();
        pen.stroke();
      }
      pen.setLineDash([]);
      const [x, y] = places.reduce((a, b) => (b[1] < a[1] ? b : a));
      this._tag(pen, x, Math.max(60 * r, y - 12 * r), fenceWords(boundary), FENCE.line);
    }
  }

  /** What moves, with the way it goes in two seconds. */
  _wires(pen) {
    const r = this._ratio;
    for (const wire of this.model.state?.wires ?? []) {
      for (const [colour, width] of [[WIRE.halo, 5 * r], [WIRE.line, 2.4 * r]]) {
        pen.strokeStyle = colour;
        pen.lineWidth = width;
        for (const seen of [true, false]) {
          pen.setLineDash(seen ? [] : [6 * r, 5 * r]);
          pen.beginPath();
          for (const [from, to] of pieces(wire).filter((piece) => piece[2] === seen)) {
            pen.moveTo(...this.place(from[0], from[1]));
            pen.lineTo(...this.place(to[0], to[1]));
          }
          pen.stroke();
        }
      }
      pen.setLineDash([]);
      const [e, n] = middle(wire);
      const [x, y] = this.place(e, n);
      this._tag(pen, x, y + 14 * r, wireWords(wire), WIRE.line);
    }
  }

  _moving(pen) {
    const r = this._ratio;
    for (const one of this.model.state?.moving ?? []) {
      const [[x, y], [tx, ty]] = [this.place(...one.enu_m), this.place(...ahead(one))];
      const angle = Math.atan2(ty - y, tx - x);
      const [size, head] = [Math.max(7 * r, radiusOf(one) * this._k), 9 * r];
      for (const [colour, width] of [[MOVING.halo, 5 * r], [MOVING.line, 2.4 * r]]) {
        pen.strokeStyle = colour;
        pen.lineWidth = width;
        pen.beginPath();
        pen.arc(x, y, size, 0, 2 * Math.PI);
        pen.moveTo(x, y);
        pen.lineTo(tx, ty);
        for (const side of [-2.6, 2.6]) {
          pen.moveTo(tx, ty);
          pen.lineTo(tx + head * Math.cos(angle + side), ty + head * Math.sin(angle + side));
        }
        pen.stroke();
      }
      this._tag(pen, x, y + size + 14 * r, movingWords(one), MOVING.line);
    }
  }

  _obstacles(pen) {
    const point = this.model.selected();
    if (!point) return;
    const r = this._ratio;
    const labelled = [];
    for (const obstacle of point.obstacles) {
      const [west, south, east, north] = obstacle.extent_m;
      pen.beginPath();
      for (const [e, n] of [[west, south], [east, south], [east, north], [west, north]]) pen.lineTo(...this.place(e, n));
      pen.closePath();
      pen.strokeStyle = "rgba(255, 159, 26, 0.95)";
      pen.fillStyle = "rgba(255, 159, 26, 0.16)";
      pen.lineWidth = 1.3 * r;
      pen.fill();
      pen.stroke();
      const [x, y] = this.place(obstacle.east_m, obstacle.north_m);
      pen.fillStyle = "#ff9f1a";
      pen.strokeStyle = "#1a0f00";
      pen.lineWidth = 1 * r;
      pen.beginPath();
      pen.moveTo(x, y - 6 * r);
      pen.lineTo(x + 5 * r, y + 3 * r);
      pen.lineTo(x - 5 * r, y + 3 * r);
      pen.closePath();
      pen.fill();
      pen.stroke();
      const crowded = labelled.some(([a, b]) => Math.abs(a - x) < 40 * r && Math.abs(b - y) < 13 * r);
      if (crowded || labelled.length >= OBSTACLE_LABELS || this.scale < 1.5) continue;
      labelled.push([x, y]);
      this._tag(pen, x, y + 12 * r, `${obstacle.height_m.toFixed(1)} m`, "#ffcf87");
    }
  }

  _tag(pen, x, y, text, colour) {
    const r = this._ratio;
    pen.font = `600 ${10.5 * r}px system-ui, sans-serif`;
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.lineWidth = 3 * r;
    pen.strokeStyle = "rgba(10, 13, 17, 0.85)";
    pen.strokeText(text, x, y);
    pen.fillStyle = colour;
    pen.fillText(text, x, y);
  }

  _path(pen) {
    const path = this.model.path;
    if (path.length < 2) return;
    pen.beginPath();
    const every = Math.max(1, Math.floor(path.length / 1500));
    for (let i = 0; i < path.length; i += every) pen.lineTo(...this.place(path[i][0], path[i][1]));
    pen.lineTo(...this.place(path.at(-1)[0], path.at(-1)[1]));
    const r = this._ratio;
    for (const [width, colour] of [[3.6, "rgba(8, 12, 18, 0.55)"], [1.6, "#f7f3c4"]]) {
      pen.lineWidth = width * r;
      pen.strokeStyle = colour;
      pen.stroke();
    }
  }

  _way(pen, pose) {
    const aim = this.model.aim();
    if (!aim || !pose) return;
    const r = this._ratio;
    pen.setLineDash([9 * r, 6 * r]);
    pen.beginPath();
    pen.moveTo(...this.place(pose.east, pose.north));
    pen.lineTo(...this.place(aim[0], aim[1]));
    for (const [width, colour] of [[4.5, "rgba(8, 12, 18, 0.6)"], [2.2, "#e85dff"]]) {
      pen.lineWidth = width * r;
      pen.strokeStyle = colour;
      pen.stroke();
    }
    pen.setLineDash([]);
  }

  /** The landing point, its largest square and its clearance. */
  _selected(pen) {
    const point = this.model.selected();
    if (!point) return;
    const [e, n] = point.enu_m;
    const style = STATE_STYLE[point.state];
    const zone = this.model.near().find((z) => z.id === point.zone);
    const r = this._ratio;
    const [x, y] = this.place(e, n);
    if (zone) this._room(pen, zone, x, y, style);
    const half = this.model.zones.footprint_m / 2;
    pen.beginPath();
    for (const [i, j] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) pen.lineTo(...this.place(e + i * half, n + j * half));
    pen.closePath();
    pen.fillStyle = style.fill;
    pen.fill();
    pen.lineWidth = 2 * r;
    pen.strokeStyle = style.line;
    pen.stroke();
    const size = 13 * r;
    pen.lineWidth = 5 * r;
    pen.strokeStyle = "rgba(6, 9, 13, 0.8)";
    for (let pass = 0; pass < 2; pass++) {
      pen.beginPath();
      pen.arc(x, y, size, 0, 7);
      if (point.state === "unsafe") {
        pen.moveTo(x - size * 0.7, y - size * 0.7);
        pen.lineTo(x + size * 0.7, y + size * 0.7);
        pen.moveTo(x + size * 0.7, y - size * 0.7);
        pen.lineTo(x - size * 0.7, y + size * 0.7);
      } else {
        pen.moveTo(x - size * 1.45, y);
        pen.lineTo(x - size * 0.5, y);
        pen.moveTo(x + size * 0.5, y);
        pen.lineTo(x + size * 1.45, y);
        pen.moveTo(x, y - size * 1.45);
        pen.lineTo(x, y - size * 0.5);
        pen.moveTo(x, y + size * 0.5);
        pen.lineTo(x, y + size * 1.45);
      }
      pen.stroke();
      pen.lineWidth = 2.4 * r;
      pen.strokeStyle = style.line;
    }
    if (point.rose) drawRose(pen, x, y, this.turn, point.rose, r);
    this._plate(pen, x, y + (point.rose ? roseRadius(r) + 24 * r : 52 * r), [`${style.mark} LANDING POINT ${style.word}`], style.line);
    this._windAt(pen, x, y);
  }

  /** The wind as an arrow that blows towards the landing point. */
  _windAt(pen, x, y) {
    const wind = this.model.state?.wind;
    if (!wind) return;
    const r = this._ratio;
    const angle = (wind.from_deg * Math.PI) / 180 + this.turn;
    const at = (away) => [x + away * Math.sin(angle), y - away * Math.cos(angle)];
    drawArrow(pen, ...at(roseRadius(r) + 6 * r), angle, 38 * r, r);
    const [tx, ty] = at(roseRadius(r) + (56 + 32 * Math.abs(Math.sin(angle))) * r);
    this._tag(pen, tx, ty, windWords(wind), WIND.line);
  }

  _room(pen, zone, x, y, style) {
    const r = this._ratio;
    const half = zone.square_m / 2;
    const [e, n] = zone.best;
    pen.setLineDash([5 * r, 4 * r]);
    pen.lineWidth = 1.4 * r;
    pen.strokeStyle = style.line;
    pen.beginPath();
    for (const [i, j] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) pen.lineTo(...this.place(e + i * half, n + j * half));
    pen.closePath();
    pen.stroke();
    if (Math.hypot(e - this.model.selected().enu_m[0], n - this.model.selected().enu_m[1]) < 1) {
      pen.beginPath();
      pen.arc(x, y, Math.max(1, zone.clearance_m * this._k), 0, 7);
      pen.stroke();
      this._tag(pen, x, y - zone.clearance_m * this._k - 9 * r, `clear ${zone.clearance_m.toFixed(1)} m`, style.line);
    }
    pen.setLineDash([]);
  }

  /** What was tapped and is not selected yet. */
  _cursor(pen) {
    const picked = this.model.picked;
    if (!picked) return;
    const at = picked.zone ? picked.zone.best : [picked.east, picked.north];
    const [x, y] = this.place(at[0], at[1]);
    const r = this._ratio;
    pen.lineWidth = 2 * r;
    pen.strokeStyle = "#ffffff";
    pen.setLineDash([4 * r, 3 * r]);
    pen.beginPath();
    pen.arc(x, y, 18 * r, 0, 7);
    pen.stroke();
    pen.setLineDash([]);
  }

  _vehicle(pen, pose) {
    const r = this._ratio;
    const [x, y] = this.place(pose.east, pose.north);
    const yaw = (pose.yaw * Math.PI) / 180 + this.turn;
    const reach = Math.max(26 * r, Math.min(400, Math.max(6, pose.height ?? 10)) * this._k);
    pen.save();
    pen.translate(x, y);
    pen.rotate(yaw);
    const field = (FIELD_DEG * Math.PI) / 180;
    const shine = pen.createRadialGradient(0, 0, 0, 0, 0, reach);
    shine.addColorStop(0, "rgba(255, 255, 255, 0.24)");
    shine.addColorStop(1, "rgba(255, 255, 255, 0.02)");
    pen.fillStyle = shine;
    pen.beginPath();
    pen.moveTo(0, 0);
    pen.arc(0, 0, reach, -Math.PI / 2 - field, -Math.PI / 2 + field);
    pen.closePath();
    pen.fill();
    pen.beginPath();
    for (const [px, py] of [[0, -15], [10, 11], [0, 5], [-10, 11]]) pen.lineTo(px * r, py * r);
    pen.closePath();
    pen.fillStyle = "#ffffff";
    pen.strokeStyle = "#0b0e12";
    pen.lineWidth = 2 * r;
    pen.fill();
    pen.stroke();
    pen.restore();
  }

  /** Scale, north, ramp of the layer. */
  _furniture(pen) {
    const r = this._ratio;
    const wanted = 110 / this.scale;
    const power = 10 ** Math.floor(Math.log10(wanted));
    const length = [5, 2, 1].map((k) => k * power).find((k) => k <= wanted) ?? power;
    const [x, y, px] = [16 * r, this._h - 18 * r, length * this._k];
    pen.lineWidth = 4 * r;
    pen.strokeStyle = "rgba(8, 12, 18, 0.8)";
    for (let pass = 0; pass < 2; pass++) {
      pen.beginPath();
      pen.moveTo(x, y - 6 * r);
      pen.lineTo(x, y);
      pen.lineTo(x + px, y);
      pen.lineTo(x + px, y - 6 * r);
      pen.stroke();
      pen.lineWidth = 1.8 * r;
      pen.strokeStyle = "#f2f5f7";
    }
    this._tag(pen, x + px / 2, y - 10 * r, `${length >= 1 ? length : length.toFixed(1)} m`, "#f2f5f7");
    this._north(pen);
    this._wind(pen);
    if (this.sheets.shown) this._ramp(pen, x, y - 42 * r, this.sheets.shown);
  }

  _north(pen) {
    const r = this._ratio;
    pen.save();
    pen.translate(30 * r, 74 * r);
    pen.rotate(this.turn);
    pen.fillStyle = "rgba(10, 13, 17, 0.72)";
    pen.beginPath();
    pen.arc(0, 0, 18 * r, 0, 7);
    pen.fill();
    pen.fillStyle = "#f2f5f7";
    pen.beginPath();
    for (const [px, py] of [[0, -14], [5, 3], [0, 0], [-5, 3]]) pen.lineTo(px * r, py * r);
    pen.fill();
    pen.font = `700 ${9.5 * r}px system-ui, sans-serif`;
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.fillText("N", 0, 10 * r);
    pen.restore();
  }

  /** The wind below north while no landing point has its arrow: towards where it blows, with its speed. */
  _wind(pen) {
    const r = this._ratio;
    const wind = this.model.state?.wind;
    const [x, y] = [30 * r, 116 * r];
    if (!wind) this._tag(pen, x + 16 * r, y - 12 * r, windWords(wind), "#c3ccd4");
    if (!wind || this.model.selected()) return;
    pen.fillStyle = "rgba(10, 13, 17, 0.72)";
    pen.beginPath();
    pen.arc(x, y, 18 * r, 0, 7);
    pen.fill();
    const angle = (wind.from_deg * Math.PI) / 180 + this.turn;
    drawArrow(pen, x - 14 * r * Math.sin(angle), y + 14 * r * Math.cos(angle), angle, 28 * r, r);
    this._tag(pen, x + 22 * r, y + 27 * r, windWords(wind), WIND.line);
  }

  _ramp(pen, x, y, layer) {
    const r = this._ratio;
    const width = 130 * r;
    const blend = pen.createLinearGradient(x, 0, x + width, 0);
    for (let i = 0; i <= 10; i++) blend.addColorStop(i / 10, rampColour(i / 10));
    pen.fillStyle = blend;
    pen.fillRect(x, y, width, 8 * r);
    const labels = [amount(0, layer.unit), layer.title.toLowerCase(), amount(layer.full, layer.unit)];
    labels.forEach((label, i) => this._tag(pen, x + 8 * r + (i * (width - 16 * r)) / 2, y - 8 * r, label, "#f2f5f7"));
  }
}
