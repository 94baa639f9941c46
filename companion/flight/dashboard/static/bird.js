// The bird's view: the map from above, drawn on a canvas.

import { SHARE } from "./background.js";
import { amount, fitCanvas } from "./dom.js";
import { ahead, MOVING, movingWords, radiusOf } from "./moving.js";
import { drawObstacle, FLOWN, movingMark, OBSTACLE, outline, pointMark, through, WAY } from "./marks.js";
import { middle, pieces, WIRE, wireWords } from "./wires.js";
import { corners, FENCE, fenceWords, isBeyond } from "./fence.js";
import { ramp } from "./paint.js";
import { drawArrow, drawRose, roseRadius, windWords, WIND } from "./rose.js";
import { ink } from "./theme.js";
import { drawSurveyed, drawZone, holds, pathOf, pattern, STATE_STYLE, styleOf, surfaceWords } from "./zones.js";

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
    const far = this.sheets.isNear(east, north) ? [] : this.model.far(); // what is covered is not picked
    const zone = [...this.model.near(), ...far].find((z) => holds(z, east, north));
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
    const over = [...this.canvas.parentNode.querySelectorAll(".tools, #legend")];
    this._taken = over.map((e) => [e.offsetLeft, e.offsetTop, e.offsetLeft + e.offsetWidth, e.offsetTop + e.offsetHeight].map((at) => at * ratio));
    this._taken.push([0, height - 40 * ratio, 150 * ratio, height], [12, 56, 48, 92].map((at) => at * ratio)); // scale, north
    if (pose) this._claim([this.place(pose.east, pose.north)], 34 * ratio, 34 * ratio, true);
    this._surveyed(pen);
    const blocks = this.sheets.view(...this._view());
    for (const far of [true, false]) {
      this._ground(pen, blocks.filter(({ sheet }) => (sheet === "far") === far)); // the near map covers the far one
      this._zones(pen, far);
    }
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

  /** What was never seen: hatched; over the background picture faint, so that most of what is unseen lies over it. */
  _unseen(pen) {
    const fill = (style, opacity) => {
      pen.globalAlpha = opacity;
      pen.fillStyle = style;
      pen.fillRect(0, 0, this._w, this._h);
      pen.globalAlpha = 1;
    };
    fill(ink("unseen"), 1);
    const tiles = this.background.view(...this._view());
    for (const tile of tiles) this._lay(pen, ...tile);
    if (tiles.length) fill(ink("unseen"), 1 - SHARE);
    else fill(pattern(pen, "unseen", this._ratio), 1);
  }

  _ground(pen, blocks) {
    for (const block of blocks) {
      const { data } = block;
      this._lay(pen, this.sheets.picture(block), data.west, data.south + data.side * data.cell, data.cell);
    }
  }

  _zones(pen, far) {
    for (const zone of far ? this.model.far() : this.model.near()) {
      const chosen = this.model.picked?.zone?.id === zone.id;
      drawZone(pen, pathOf(zone, this.place), zone, { far, chosen, width: 1.8 * this._ratio, scale: this._ratio });
    }
  }

  /** What a survey before the flight found, below all that was seen since. */
  _surveyed(pen) {
    for (const zone of this.model.prior()) drawSurveyed(pen, pathOf(zone, this.place), this._ratio);
  }

  _names(pen) {
    const r = this._ratio;
    const far = this.model.far().filter(({ best: [e, n] }) => !this.sheets.isNear(e, n));
    for (const [zone, suffix] of [...this.model.near().map((z) => [z, ""]), ...far.map((z) => [z, " far"])]) {
      const [x, y] = this.place(zone.best[0], zone.best[1]);
      if (zone.area_m2 * this._k * this._k < 900 * r * r && zone.rank > 4) continue;
      const surface = surfaceWords(zone);
      const drawn = this._plate(pen, x, y, 8 * r, [
        `${zone.id}${suffix} · ${Math.round(zone.area_m2)} m²`,
        this.model.sureWords(zone),
        ...(surface ? [surface] : []),
        ...(isBeyond(this.model, zone) ? ["beyond the fence"] : []),
      ]);
      if (!drawn) continue;
      pen.fillStyle = styleOf(zone).line;
      pen.strokeStyle = ink("halo");
      pen.lineWidth = 2 * r;
      pen.beginPath();
      pen.arc(x, y, 3.2 * r, 0, 7);
      pen.stroke();
      pen.fill();
    }
  }

  /** Claim the first of some places (middles) where a box of this size is in view and covers nothing claimed before. */
  _claim(places, width, height, must = false) {
    const boxes = places.map(([x, y]) => [x - width / 2, y - height / 2, x + width / 2, y + height / 2]);
    const view = [0, 0, this._w, this._h];
    const common = (a, b) => Math.max(0, Math.min(a[2], b[2]) - Math.max(a[0], b[0])) * Math.max(0, Math.min(a[3], b[3]) - Math.max(a[1], b[1]));
    const covered = boxes.map((box) => width * height - common(box, view) + this._taken.reduce((sum, t) => sum + common(box, t), 0));
    const at = covered.indexOf(Math.min(...covered)); // where nothing is free, what must stand covers least
    if (covered[at] > 0.5 && !must) return null;
    this._taken.push(boxes[at]);
    return places[at];
  }

  /** Lines of text on a plate beside a point, away from it by a gap; tell whether there was room. */
  _plate(pen, x, y, gap, lines, colour = ink("text"), must = false) {
    const r = this._ratio;
    pen.font = `600 ${11.5 * r}px system-ui, sans-serif`;
    pen.textAlign = "center";
    pen.textBaseline = "bottom";
    const width = Math.max(...lines.map((line) => pen.measureText(line).width)) + 10 * r;
    const high = lines.length * 14 * r + 4 * r;
    const places = [gap, gap + 16 * r].flatMap((away) => {
      const [aside, over] = [away + width / 2, away + high / 2];
      const four = [[x, y - over], [x + aside, y], [x - aside, y], [x, y + over]];
      return must ? four.reverse() : four;
    });
    const place = this._claim(places, width, high, must);
    if (!place) return false;
    const [left, top] = [place[0] - width / 2, place[1] - high / 2];
    pen.fillStyle = ink("label");
    pen.beginPath();
    pen.roundRect(left, top, width, high, 4 * r);
    pen.fill();
    lines.forEach((line, i) => {
      pen.font = `${i ? 400 : 600} ${(i ? 10.5 : 11.5) * r}px system-ui, sans-serif`;
      pen.fillStyle = i ? ink("text") : colour;
      pen.fillText(line, place[0], top + (i + 1) * 14 * r + 1 * r);
    });
    return true;
  }

  /** The autopilot's fence: dashes, and in words which side of them is forbidden. */
  _fence(pen) {
    const r = this._ratio;
    for (const boundary of this.model.state?.fence?.boundaries ?? []) {
      const places = corners(boundary).map(([e, n]) => this.place(e, n));
      outline(pen, through(places, true), FENCE, 2.4 * r, [12 * r, 5 * r]);
      const [x, y] = places.reduce((a, b) => (b[1] < a[1] ? b : a));
      this._tag(pen, [[x, Math.max(60 * r, y - 12 * r)]], fenceWords(boundary), FENCE.line);
    }
  }

  /** Wires: lines where they were seen, dashes where they go on. */
  _wires(pen) {
    const r = this._ratio;
    for (const wire of this.model.state?.wires ?? []) {
      for (const shown of [true, false]) {
        const path = new Path2D();
        const parts = pieces(wire).filter(([, , seen]) => seen === shown);
        for (const ends of parts) path.addPath(through(ends.slice(0, 2).map(([e, n]) => this.place(e, n))));
        outline(pen, path, WIRE, 2.4 * r, shown ? [] : [6 * r, 5 * r]);
      }
      const [e, n] = middle(wire);
      const [x, y] = this.place(e, n);
      this._tag(pen, [[x, y + 14 * r]], wireWords(wire), WIRE.line);
    }
  }

  /** What moves, with the way it goes in two seconds. */
  _moving(pen) {
    const r = this._ratio;
    for (const one of this.model.state?.moving ?? []) {
      const [x, y] = this.place(...one.enu_m);
      const size = Math.max(7 * r, radiusOf(one) * this._k);
      outline(pen, movingMark([x, y], this.place(...ahead(one)), size, 9 * r), MOVING, 2.4 * r);
      this._tag(pen, [[x, y + size + 14 * r]], movingWords(one), MOVING.line);
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
      pen.strokeStyle = OBSTACLE.line;
      pen.fillStyle = OBSTACLE.fill;
      pen.lineWidth = 1.3 * r;
      pen.fill();
      pen.stroke();
      const [x, y] = this.place(obstacle.east_m, obstacle.north_m);
      drawObstacle(pen, x, y, r);
      const crowded = labelled.some(([a, b]) => Math.abs(a - x) < 40 * r && Math.abs(b - y) < 13 * r);
      if (crowded || labelled.length >= OBSTACLE_LABELS || this.scale < 1.5) continue;
      labelled.push([x, y]);
      this._tag(pen, [[x, y + 12 * r]], `${obstacle.height_m.toFixed(1)} m`, OBSTACLE.line);
    }
  }

  /** Words at the first place that is free; if they must be drawn, else at the first. */
  _tag(pen, places, text, colour, must = places.length === 1) {
    const r = this._ratio;
    pen.font = `600 ${10.5 * r}px system-ui, sans-serif`;
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    const place = this._claim(places, pen.measureText(text).width + 4 * r, 13 * r, must);
    if (!place) return;
    const [x, y] = place;
    pen.lineWidth = 3 * r;
    pen.strokeStyle = ink("halo");
    pen.strokeText(text, x, y);
    pen.fillStyle = colour;
    pen.fillText(text, x, y);
  }

  _path(pen) {
    const path = this.model.path;
    if (path.length < 2) return;
    const every = Math.max(1, Math.floor(path.length / 1500));
    const places = path.filter((_, i) => i % every === 0 || i === path.length - 1).map(([e, n]) => this.place(e, n));
    outline(pen, through(places), FLOWN, 1.6 * this._ratio);
  }

  _way(pen, pose) {
    const aim = this.model.aim();
    if (!aim || !pose) return;
    const r = this._ratio;
    outline(pen, through([this.place(pose.east, pose.north), this.place(aim[0], aim[1])]), WAY, 2.2 * r, [9 * r, 6 * r]);
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
    outline(pen, pointMark(x, y, 13 * r, point.state === "unsafe"), style, 2.4 * r);
    if (point.rose) drawRose(pen, x, y, this.turn, point.rose, r);
    const far = point.rose ? roseRadius(r) : 28 * r;
    this._claim([[x, y]], 2 * far, 2 * far, true);
    this._plate(pen, x, y, far + 2 * r, [`${style.mark} LANDING POINT ${style.word}`], style.line, true);
    this._windAt(pen, x, y);
    if (!zone || Math.hypot(e - zone.best[0], n - zone.best[1]) >= 1) return;
    const away = Math.max(far, zone.clearance_m * this._k);
    const around = [0, 4, 2, 6, 1, 7, 3, 5].map((eighth) => (eighth * Math.PI) / 4);
    this._tag(pen, around.map((angle) => [x + (away + 36 * r) * Math.sin(angle), y - (away + 9 * r) * Math.cos(angle)]), `clear ${zone.clearance_m.toFixed(1)} m`, style.line);
  }

  /** The wind as an arrow that blows towards the landing point. */
  _windAt(pen, x, y) {
    const wind = this.model.state?.wind;
    if (!wind) return;
    const r = this._ratio;
    const angle = (wind.from_deg * Math.PI) / 180 + this.turn;
    const at = (away) => [x + away * Math.sin(angle), y - away * Math.cos(angle)];
    drawArrow(pen, ...at(roseRadius(r) + 6 * r), angle, 38 * r, r);
    this._claim([at(roseRadius(r) + 25 * r)], (16 + 38 * Math.abs(Math.sin(angle))) * r, (16 + 38 * Math.abs(Math.cos(angle))) * r, true);
    const beside = [-22, 22, -34, 34].map((aside) => at(roseRadius(r) + 25 * r).map((middle, i) => middle + (i ? aside * r : 0)));
    this._tag(pen, [at(roseRadius(r) + (56 + 32 * Math.abs(Math.sin(angle))) * r), ...beside], windWords(wind), WIND.line, true);
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
    pen.strokeStyle = ink("chosen");
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
    shine.addColorStop(0, ink("shine"));
    shine.addColorStop(1, `${ink("shine").slice(0, 7)}05`);
    pen.fillStyle = shine;
    pen.beginPath();
    pen.moveTo(0, 0);
    pen.arc(0, 0, reach, -Math.PI / 2 - field, -Math.PI / 2 + field);
    pen.closePath();
    pen.fill();
    pen.beginPath();
    for (const [px, py] of [[0, -15], [10, 11], [0, 5], [-10, 11]]) pen.lineTo(px * r, py * r);
    pen.closePath();
    pen.fillStyle = ink("chosen");
    pen.strokeStyle = ink("halo");
    pen.lineWidth = 4 * r;
    pen.stroke();
    pen.fill();
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
    pen.strokeStyle = ink("halo");
    for (let pass = 0; pass < 2; pass++) {
      pen.beginPath();
      pen.moveTo(x, y - 6 * r);
      pen.lineTo(x, y);
      pen.lineTo(x + px, y);
      pen.lineTo(x + px, y - 6 * r);
      pen.stroke();
      pen.lineWidth = 1.8 * r;
      pen.strokeStyle = ink("text");
    }
    this._tag(pen, [[x + px / 2, y - 10 * r]], `${length >= 1 ? length : length.toFixed(1)} m`, ink("text"));
    this._north(pen);
    this._wind(pen);
    if (this.sheets.shown) this._ramp(pen, x, y - 42 * r, this.sheets.shown);
  }

  _north(pen) {
    const r = this._ratio;
    pen.save();
    pen.translate(30 * r, 74 * r);
    pen.rotate(this.turn);
    pen.fillStyle = ink("label");
    pen.beginPath();
    pen.arc(0, 0, 18 * r, 0, 7);
    pen.fill();
    pen.fillStyle = ink("text");
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
    if (!wind) this._tag(pen, [[x + 16 * r, y - 12 * r]], windWords(wind), ink("text"));
    if (!wind || this.model.selected()) return;
    pen.fillStyle = ink("label");
    pen.beginPath();
    pen.arc(x, y, 18 * r, 0, 7);
    pen.fill();
    const angle = (wind.from_deg * Math.PI) / 180 + this.turn;
    drawArrow(pen, x - 14 * r * Math.sin(angle), y + 14 * r * Math.cos(angle), angle, 28 * r, r);
    this._tag(pen, [[x + 22 * r, y + 27 * r]], windWords(wind), WIND.line);
  }

  _ramp(pen, x, y, layer) {
    const r = this._ratio;
    const width = 130 * r;
    const blend = pen.createLinearGradient(x, 0, x + width, 0);
    ramp().forEach((colour, i, { length }) => blend.addColorStop(i / (length - 1), colour));
    pen.fillStyle = blend;
    pen.fillRect(x, y, width, 8 * r);
    const labels = [amount(0, layer.unit), layer.title.toLowerCase(), amount(layer.full, layer.unit)];
    labels.forEach((label, i) => this._tag(pen, [[x + 8 * r + (i * (width - 16 * r)) / 2, y - 8 * r]], label, ink("text")));
  }
}
