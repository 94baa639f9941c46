// The pilot's view: the ground, zones, posts and the way down in space, with an instrument's numbers over it.

import { fitCanvas } from "./dom.js";
import { add, drawsInSoftware, looking, multiply, perspective, program, project } from "./gl.js";
import { corners } from "./fence.js";
import { Terrain } from "./terrain.js";
import { ahead, MOVING, movingWords, radiusOf } from "./moving.js";
import { middle, pieces, WIRE, wireWords } from "./wires.js";
import { drawArrow, petals, reach, STEP_DEG, WAYS, WIND, windWords } from "./rose.js";
import { ink, tint } from "./theme.js";
import { STATE_STYLE, styleOf, surfaceWords } from "./zones.js";

const FRAME_MS = 60;
const FIELD = (56 * Math.PI) / 180;
const REACH_M = 110;
const EYE_DOWN_DEG = 28;
const GRID_M = 20;
const GATE_M = 4;
const GATE_STEP_M = 6;
const ROSE_M = [3.5, 5, 9]; // inner radius, and those of the shortest and the longest petal
const FENCE_M = 1.3; // height of a blocked bearing's fence
const WALL_OVER_M = 5; // of the walls of the autopilot's fence over the vehicle
const WIND_M = [10.5, 16]; // head and tail of the wind's arrow from the point

const LINE_VERTEX = `
in vec3 place;
in vec4 tint;
uniform mat4 matrix;
out vec4 shade;
void main() { shade = tint; gl_Position = matrix * vec4(place, 1.0); }`;
const LINE_FRAGMENT = `
in vec4 shade;
out vec4 colour;
void main() { colour = shade; }`;

export class PilotView {
  constructor(canvas, hud, model, sheets) {
    Object.assign(this, { canvas, hud, model, sheets });
    this.frames = 0;
    this.camera = "chase";
    this.look = { yaw: 0, pitch: 0, zoom: 1 };
    this._last = 0;
    this.plain = drawsInSoftware(); // then fewer triangles and pixels, no smooth edges
    this.gl = canvas.getContext("webgl2", { antialias: !this.plain, alpha: false });
    if (!this.gl) {
      document.getElementById("no-space").hidden = false;
      return;
    }
    this._start();
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => this._start());
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

  use(camera) {
    this.camera = camera;
    this.look = { yaw: 0, pitch: 0, zoom: 1 };
  }

  _start() {
    const { gl } = this;
    this.terrain = new Terrain(gl, this.sheets, this.model, this.plain ? 4 : 2);
    this.lines = program(gl, LINE_VERTEX, LINE_FRAGMENT);
    this.buffer = gl.createBuffer();
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  }

  _listen() {
    const held = new Map(); // fingers by id
    this.canvas.addEventListener("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      held.set(event.pointerId, [event.offsetX, event.offsetY]);
    });
    this.canvas.addEventListener("pointermove", (event) => {
      const before = held.get(event.pointerId);
      if (!before) return;
      const span = spanOf(held);
      held.set(event.pointerId, [event.offsetX, event.offsetY]);
      if (held.size > 1) this._zoom(span / spanOf(held));
      else this._turn(0.35 * (event.offsetX - before[0]), 0.25 * (event.offsetY - before[1]));
    });
    for (const end of ["pointerup", "pointercancel"]) this.canvas.addEventListener(end, (event) => held.delete(event.pointerId));
    this.canvas.addEventListener("dblclick", () => this.use(this.camera));
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this._zoom(Math.exp(0.001 * event.deltaY));
    }, { passive: false });
    this.canvas.addEventListener("keydown", (event) => {
      const turn = { ArrowLeft: [-6, 0], ArrowRight: [6, 0], ArrowUp: [0, 5], ArrowDown: [0, -5] }[event.key];
      if (!turn) return;
      this._turn(turn[0], turn[1]);
      event.preventDefault();
    });
  }

  _turn(yaw, pitch) {
    this.look.yaw += yaw;
    this.look.pitch = Math.min(60, Math.max(-60, this.look.pitch + pitch));
  }

  _zoom(factor) {
    this.look.zoom = Math.min(4, Math.max(0.4, this.look.zoom * factor));
  }

  // ---- drawing ---------------------------------------------------------------------------------

  _draw(now) {
    const { gl } = this;
    const drawn = fitCanvas(this.canvas, this.plain ? 0.6 : 1);
    const { width, height, ratio } = fitCanvas(this.hud);
    gl.viewport(0, 0, drawn.width, drawn.height);
    const sky = tint("sky").slice(0, 3);
    gl.clearColor(...sky, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const pen = this.hud.getContext("2d");
    pen.clearRect(0, 0, width, height);
    const pose = this.model.pose(now);
    if (gl.isContextLost()) return;
    if (!pose) return this._noPosition(pen, width, height, ratio);
    const view = this._view(pose);
    const matrix = multiply(perspective(FIELD, width / height, 0.5, 8000), looking(view.eye, view.forward, view.up));
    this._backdrop(view, pose);
    this.terrain.draw(matrix, [view.middle[0], view.middle[1]], REACH_M, sky);
    this._solids(matrix, pose);
    this._labels(pen, matrix, width, height, ratio);
    this._instruments(pen, pose, view, matrix, width, height, ratio);
  }

  /** Where nothing can be drawn: why. */
  _noPosition(pen, width, height, r) {
    const { state } = this.model;
    const words = !state ? "" : state.connected ? `No position, last ${this.model.since("position")}` : "No autopilot: no position";
    pen.font = `700 ${18 * r}px system-ui, sans-serif`;
    pen.textAlign = "center";
    pen.fillStyle = ink("text");
    pen.fillText(words, width / 2, height / 2);
  }

  _view(pose) {
    const yaw = ((pose.yaw + this.look.yaw) * Math.PI) / 180;
    if (this.camera === "eye") {
      const pitch = ((pose.pitch - EYE_DOWN_DEG + this.look.pitch) * Math.PI) / 180;
      const forward = [Math.sin(yaw) * Math.cos(pitch), Math.cos(yaw) * Math.cos(pitch), Math.sin(pitch)];
      const right = [Math.cos(yaw), -Math.sin(yaw), 0];
      const roll = (pose.roll * Math.PI) / 180;
      const up = add([0, 0, Math.cos(roll)], right, Math.sin(roll));
      const eye = [pose.east, pose.north, pose.up];
      return { eye, forward, up, middle: add(eye, [Math.sin(yaw), Math.cos(yaw), 0], 0.45 * REACH_M) };
    }
    const far = 26 * this.look.zoom;
    const pitch = Math.min(1.5, Math.max(0.06, ((30 + this.look.pitch) * Math.PI) / 180));
    const from = [-Math.sin(yaw) * Math.cos(pitch), -Math.cos(yaw) * Math.cos(pitch), Math.sin(pitch)];
    const target = [pose.east, pose.north, pose.up - 3 * this.look.zoom];
    const eye = add([pose.east, pose.north, pose.up], from, far);
    const forward = add(target, eye, -1);
    return { eye, forward, up: [0, 0, 1], middle: [pose.east + 25 * Math.sin(yaw), pose.north + 25 * Math.cos(yaw), 0] };
  }

  /** Dark ground below the horizon where nothing was seen. */
  _backdrop(view, pose) {
    this._shapes = { lines: [], faces: [] };
    const [e, n] = view.eye;
    const far = 5000;
    const ground = pose.up - Math.max(2, this.model.state?.height_m ?? this.model.state?.height_home_m ?? 20) - 1.5;
    const low = ground - 40; // below all ground that was seen, which it would hide
    this._face([e - far, n - far, low], [e + far, n - far, low], [e + far, n + far, low], [e - far, n + far, low], tint("unseen"));
    const [e0, n0] = [GRID_M * Math.round(e / GRID_M), GRID_M * Math.round(n / GRID_M)];
    for (let k = -10; k <= 10; k++) {
      const [reach, at] = [10 * GRID_M, k * GRID_M];
      this._line([e0 + at, n0 - reach, ground], [e0 + at, n0 + reach, ground], tint("unseen-hatch"));
      this._line([e0 - reach, n0 + at, ground], [e0 + reach, n0 + at, ground], tint("unseen-hatch"));
    }
  }

  _solids(matrix, pose) {
    const { gl } = this;
    this._zoneLines();
    this._rose();
    this._fence(pose);
    this._wires();
    this._moving();
    this._windArrow();
    this._posts();
    this._flown();
    this._corridor(pose);
    if (this.camera === "chase") this._vehicle(pose);
    gl.useProgram(this.lines.made);
    gl.uniformMatrix4fv(this.lines.uniforms.matrix, false, matrix);
    this._flush(gl.TRIANGLES, this._shapes.faces);
    this._flush(gl.LINES, this._shapes.lines);
  }

  _flush(kind, numbers) {
    if (!numbers.length) return;
    const { gl } = this;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(numbers), gl.DYNAMIC_DRAW);
    for (const [name, size, at] of [["place", 3, 0], ["tint", 4, 12]]) {
      const where = gl.getAttribLocation(this.lines.made, name);
      gl.enableVertexAttribArray(where);
      gl.vertexAttribPointer(where, size, gl.FLOAT, false, 28, at);
    }
    gl.drawArrays(kind, 0, numbers.length / 7);
  }

  _line(a, b, tint) {
    this._shapes.lines.push(...a, ...tint, ...b, ...tint);
  }

  _face(a, b, c, d, tint) {
    for (const corner of [a, b, c, a, c, d]) this._shapes.faces.push(...corner, ...tint);
  }

  /** A standing or lying bar, thick enough to be seen. */
  _bar(a, b, half, tint) {
    const along = Math.abs(b[2] - a[2]) > Math.hypot(b[0] - a[0], b[1] - a[1]);
    const sides = along ? [[half, 0, 0], [0, half, 0]] : [[0, 0, half], crossed(a, b, half)];
    for (const side of sides) this._face(add(a, side), add(b, side), add(b, side, -1), add(a, side, -1), tint);
  }

  _zoneLines() {
    const point = this.model.selected();
    if (!point) return;
    const shade = tint(point.state);
    const up = (point.height_m ?? point.enu_m[2] ?? 0) + 0.25;
    const [e, n] = point.enu_m;
    const zone = this.model.near().find((z) => z.id === point.zone);
    const half = this.model.zones.footprint_m / 2;
    const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([i, j]) => [e + i * half, n + j * half, up]);
    this._face(...corners, tint(point.state, 0.45));
    corners.forEach((corner, i) => this._bar(corner, corners[(i + 1) % 4], 0.12, shade));
    this._bar([e, n, up], [e, n, up + 4], 0.08, shade);
    if (!zone) return;
    let last = null;
    for (let i = 0; i <= 40; i++) {
      const angle = (i * Math.PI) / 20;
      const next = [e + zone.clearance_m * Math.sin(angle), n + zone.clearance_m * Math.cos(angle), up + 0.1];
      if (last && i % 2) this._bar(last, next, 0.07, shade);
      last = next;
    }
  }

  /** Ways in and out: clear ones rise as petals at their slope, a fence stands across blocked ones. */
  _rose() {
    const point = this.model.selected();
    if (!point?.rose) return;
    const up = (point.height_m ?? point.enu_m[2] ?? 0) + 0.3;
    const at = (bearing, away, rise) => {
      const angle = (bearing * Math.PI) / 180;
      return [point.enu_m[0] + away * Math.sin(angle), point.enu_m[1] + away * Math.cos(angle), up + rise];
    };
    const [inner, short, long] = ROSE_M;
    for (const petal of petals(point.rose)) {
      const { name } = WAYS[petal.state];
      const far = petal.state === "c" ? short + reach(petal) * (long - short) : short;
      const rise = petal.state === "c" ? (far - inner) * Math.tan((Math.min(45, petal.slope) * Math.PI) / 180) : 0;
      for (let bearing = petal.first; bearing <= petal.last; bearing += STEP_DEG) {
        const [left, right] = [bearing - STEP_DEG / 2, bearing + STEP_DEG / 2];
        const near = [at(left, inner, 0), at(right, inner, 0)];
        const away = [at(left, far, rise), at(right, far, rise)];
        if (petal.state === "c") this._face(near[0], near[1], away[1], away[0], tint(`${name}-fill`, 0.6));
        if (petal.state === "b") {
          const tops = [at(left, inner, FENCE_M), at(right, inner, FENCE_M)];
          for (const [c, d] of [tops, away]) {
            this._face(near[0], near[1], d, c, tint(name, 0.7));
            this._line(near[0], d, tint("bars"));
            this._line(near[1], c, tint("bars"));
          }
        }
        if (petal.state !== "u") this._line(...away, tint(name));
        else if (bearing % 10 === 0) for (const edge of [near, away]) this._line(...edge, tint(name, 0.9));
      }
      for (const side of [petal.first - STEP_DEG / 2, petal.last + STEP_DEG / 2]) {
        this._line(at(side, inner, 0), at(side, far, rise), tint(name));
      }
    }
  }

  /** The autopilot's fence as walls up to its ceiling, or to above the vehicle. */
  _fence(pose) {
    const fence = this.model.state?.fence;
    if (!fence) return;
    const [low, high] = [this._level(), fence.highest_m ?? Math.max(this._level(), pose.up) + WALL_OVER_M];
    for (const boundary of fence.boundaries) {
      const ring = corners(boundary);
      ring.forEach((from, i) => {
        const to = ring[(i + 1) % ring.length];
        this._face([...from, low], [...to, low], [...to, high], [...from, high], tint("fence", 0.16));
        for (const up of [low, high]) this._line([...from, up], [...to, up], tint("fence"));
        this._line([...from, low], [...from, high], tint("fence", 0.6));
      });
    }
  }

  /** Wires as bars, thin where they are only expected. */
  _wires() {
    for (const wire of this.model.state?.wires ?? []) {
      for (const [from, to, seen] of pieces(wire)) this._bar(from, to, seen ? 0.12 : 0.05, tint("wire"));
    }
  }

  /** What moves, as a cage of its size, and a bar to where it will be in two seconds. */
  _moving() {
    const up = this._level();
    const shade = tint("moving");
    for (const one of this.model.state?.moving ?? []) {
      const [[e, n], half] = [one.enu_m, radiusOf(one)];
      const ring = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([i, j]) => [e + i * half, n + j * half]);
      ring.forEach((corner, i) => {
        const next = ring[(i + 1) % 4];
        for (const z of [up + 0.1, up + one.height_m]) this._bar([...corner, z], [...next, z], 0.06, shade);
        this._bar([...corner, up], [...corner, up + one.height_m], 0.06, shade);
      });
      this._bar([e, n, up + 0.3], [...ahead(one), up + 0.3], 0.1, shade);
    }
  }

  /** Height of the ground at the landing point; 0 without one. */
  _level() {
    const point = this.model.selected();
    return point?.height_m ?? point?.enu_m[2] ?? 0;
  }

  /** The wind as an arrow beside the landing point, towards where it blows. */
  _windArrow() {
    const [point, wind] = [this.model.selected(), this.model.state?.wind];
    if (!point || !wind) return;
    const shade = tint("wind");
    const angle = (wind.from_deg * Math.PI) / 180;
    const [east, north] = [Math.sin(angle), Math.cos(angle)];
    const at = (away, aside) => [point.enu_m[0] + away * east + aside * north, point.enu_m[1] + away * north - aside * east, this._windUp(point)];
    const [head, tail] = WIND_M;
    this._face(at(head + 1.6, -0.3), at(head + 1.6, 0.3), at(tail, 0.3), at(tail, -0.3), shade);
    this._face(at(head, 0), at(head + 1.8, 1), at(head + 1.8, -1), at(head, 0), shade);
  }

  _windUp(point) {
    return (point.height_m ?? point.enu_m[2] ?? 0) + 2;
  }

  _posts() {
    for (const obstacle of this.model.selected()?.obstacles ?? []) {
      const top = [obstacle.east_m, obstacle.north_m, obstacle.top_m + 0.3];
      const foot = [obstacle.east_m, obstacle.north_m, obstacle.top_m - obstacle.height_m];
      this._bar(foot, top, 0.13, tint("obstacle"));
      const [west, south, east, north] = obstacle.extent_m;
      const z = obstacle.top_m + 0.15;
      const ring = [[west, south, z], [east, south, z], [east, north, z], [west, north, z]];
      ring.forEach((corner, i) => this._line(corner, ring[(i + 1) % 4], tint("obstacle")));
    }
  }

  _flown() {
    const path = this.model.path.slice(-600);
    for (let i = 1; i < path.length; i++) this._line(path[i - 1], path[i], tint("flown", 0.8));
  }

  /** The way to the point: over it at this height, then down, as gates to fly through. */
  _corridor(pose) {
    const aim = this.model.aim();
    if (!aim) return;
    const shade = tint("way");
    const here = [pose.east, pose.north, pose.up];
    const above = [aim[0], aim[1], Math.max(pose.up, aim[2])];
    const way = Math.hypot(above[0] - here[0], above[1] - here[1]);
    const forward = way > 0.5 ? [(above[0] - here[0]) / way, (above[1] - here[1]) / way, 0] : [0, 1, 0];
    const right = [forward[1], -forward[0], 0];
    for (let at = GATE_STEP_M; at < way; at += GATE_STEP_M) this._gate(add(here, forward, at), right, [0, 0, 1], shade);
    for (let up = above[2] - 2; up > aim[2] + 0.4; up -= 3) this._gate([aim[0], aim[1], up], [1, 0, 0], [0, 1, 0], shade);
    this._bar(above, aim, 0.06, shade);
    if (way > 2) this._bar(here, above, 0.06, shade);
  }

  _gate(middle, x, y, shade) {
    const half = GATE_M / 2;
    const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([i, j]) => add(add(middle, x, i * half), y, j * half));
    corners.forEach((corner, i) => this._line(corner, corners[(i + 1) % 4], shade));
    this._face(...corners, [...shade.slice(0, 3), 0.08]);
  }

  _vehicle(pose) {
    const yaw = (pose.yaw * Math.PI) / 180;
    const at = [pose.east, pose.north, pose.up];
    const turned = (f, r, u) => add(at, [Math.sin(yaw) * f + Math.cos(yaw) * r, Math.cos(yaw) * f - Math.sin(yaw) * r, u]);
    const white = tint("chosen");
    for (const [f, r] of [[0.9, 0.9], [0.9, -0.9], [-0.9, 0.9], [-0.9, -0.9]]) {
      this._bar(turned(0, 0, 0), turned(f, r, 0.05), 0.09, white);
      const disc = [...Array(12).keys()].map((i) => turned(f + 0.5 * Math.sin(i * 0.5236), r + 0.5 * Math.cos(i * 0.5236), 0.15));
      for (let i = 1; i < 11; i++) this._face(disc[0], disc[i], disc[i + 1], disc[0], tint(f > 0 ? "fore" : "aft", 0.9));
    }
    this._face(turned(0.5, 0, 0.12), turned(-0.3, 0.3, 0.12), turned(-0.15, 0, 0.12), turned(-0.3, -0.3, 0.12), white);
    if (pose.height > 1) this._line(at, [pose.east, pose.north, pose.up - pose.height], tint("chosen", 0.5));
  }

  // ---- words -----------------------------------------------------------------------------------

  _labels(pen, matrix, width, height, r) {
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    const taken = [];
    const label = (place, text, shade) => {
      const at = project(matrix, place, width, height);
      if (!at || at[2] > 160 || at[0] < 0 || at[1] < 40 * r || at[0] > width || at[1] > height) return;
      pen.font = `600 ${11.5 * r}px system-ui, sans-serif`;
      const half = pen.measureText(text).width / 2 + 6 * r;
      const box = [at[0] - half, at[1] - 10 * r, at[0] + half, at[1] + 10 * r];
      if (taken.some((t) => box[0] < t[2] && box[2] > t[0] && box[1] < t[3] && box[3] > t[1])) return;
      taken.push(box);
      pen.fillStyle = ink("label");
      pen.beginPath();
      pen.roundRect(box[0], box[1], 2 * half, 20 * r, 4 * r);
      pen.fill();
      pen.fillStyle = shade;
      pen.fillText(text, at[0], at[1] + 1);
    };
    const point = this.model.selected();
    if (point) {
      const style = STATE_STYLE[point.state];
      label([point.enu_m[0], point.enu_m[1], (point.height_m ?? 0) + 4.6], `${style.mark} ${style.word}`, style.line);
    }
    for (const wire of this.model.state?.wires ?? []) label(middle(wire), wireWords(wire), WIRE.line);
    for (const one of this.model.state?.moving ?? []) {
      label([...one.enu_m, this._level() + one.height_m + 0.8], movingWords(one), MOVING.line);
    }
    const wind = this.model.state?.wind;
    if (point && wind) {
      const angle = (wind.from_deg * Math.PI) / 180;
      const [, tail] = WIND_M;
      label([point.enu_m[0] + tail * Math.sin(angle), point.enu_m[1] + tail * Math.cos(angle), this._windUp(point) + 0.8], windWords(wind), WIND.line);
    }
    for (const obstacle of (point?.obstacles ?? []).slice(0, 14)) {
      label([obstacle.east_m, obstacle.north_m, obstacle.top_m + 1.2], `${obstacle.height_m.toFixed(1)} m`, ink("obstacle"));
    }
    for (const zone of this.model.near()) {
      if (zone.id === point?.zone) continue;
      label([zone.best[0], zone.best[1], zone.best[2] + 1], [`${zone.id} · ${Math.round(zone.area_m2)} m²`, surfaceWords(zone)].filter(Boolean).join(" · "), styleOf(zone).line);
    }
  }

  _instruments(pen, pose, view, matrix, width, height, r) {
    this._heading(pen, pose, width, r);
    if (this.camera === "eye") this._horizon(pen, pose, view, matrix, width, height, r);
    this._wind(pen, pose, height, r);
    const v = pose.velocity ?? [0, 0, 0];
    const numbers = [
      [28 * r, "left", Math.hypot(v[0], v[1]).toFixed(1), "m/s"],
      [width - 28 * r, "right", pose.height === null ? "–" : pose.height.toFixed(1), "m over ground"],
    ];
    for (const [x, side, value, unit] of numbers) {
      const y = height - 34 * r;
      pen.textAlign = side;
      pen.textBaseline = "alphabetic";
      pen.lineWidth = 4 * r;
      pen.strokeStyle = ink("halo");
      pen.fillStyle = ink("chosen");
      pen.font = `700 ${30 * r}px system-ui, sans-serif`;
      pen.strokeText(value, x, y);
      pen.fillText(value, x, y);
      pen.font = `600 ${11.5 * r}px system-ui, sans-serif`;
      pen.strokeText(unit, x, y + 17 * r);
      pen.fillText(unit, x, y + 17 * r);
    }
  }

  /** The wind over the ground speed: an arrow towards where it blows, with the way that is looked as its top. */
  _wind(pen, pose, height, r) {
    const wind = this.model.state?.wind;
    const [x, y] = [44 * r, height - 104 * r];
    pen.fillStyle = ink("label");
    if (wind) {
      pen.beginPath();
      pen.arc(x, y, 18 * r, 0, 7);
      pen.fill();
      const angle = ((wind.from_deg - pose.yaw - this.look.yaw) * Math.PI) / 180;
      drawArrow(pen, x - 14 * r * Math.sin(angle), y + 14 * r * Math.cos(angle), angle, 28 * r, r);
    }
    pen.font = `600 ${11.5 * r}px system-ui, sans-serif`;
    pen.textAlign = "left";
    pen.textBaseline = "alphabetic";
    pen.lineWidth = 4 * r;
    pen.strokeStyle = ink("halo");
    pen.fillStyle = wind ? WIND.line : ink("text");
    pen.strokeText(windWords(wind), 28 * r, y + 34 * r);
    pen.fillText(windWords(wind), 28 * r, y + 34 * r);
  }

  _heading(pen, pose, width, r) {
    const [middle, y, per] = [width / 2, 12 * r, 3 * r];
    const half = Math.min(150 * r, width / 2 - 136 * r);
    if (half < 40 * r) return;
    pen.save();
    pen.fillStyle = ink("label");
    pen.beginPath();
    pen.roundRect(middle - half, y, 2 * half, 30 * r, 5 * r);
    pen.fill();
    pen.clip();
    pen.strokeStyle = pen.fillStyle = ink("text");
    pen.lineWidth = 1.2 * r;
    pen.textAlign = "center";
    pen.textBaseline = "top";
    const names = { 0: "N", 90: "E", 180: "S", 270: "W" };
    for (let d = -60; d <= 60; d++) {
      const bearing = (Math.round(pose.yaw) + d + 720) % 360;
      if (bearing % 10) continue;
      const x = middle + (d + Math.round(pose.yaw) - pose.yaw) * per;
      pen.beginPath();
      pen.moveTo(x, y + 30 * r);
      pen.lineTo(x, y + (bearing % 30 ? 25 : 22) * r);
      pen.stroke();
      pen.font = `${bearing in names ? 700 : 500} ${11 * r}px system-ui, sans-serif`;
      if (bearing % 30 === 0) pen.fillText(names[bearing] ?? String(bearing), x, y + 6 * r);
    }
    pen.restore();
    pen.fillStyle = ink("focus");
    pen.beginPath();
    for (const [px, py] of [[-6, 36], [6, 36], [0, 27]]) pen.lineTo(middle + px * r, y + py * r);
    pen.fill();
  }

  /** The horizon and a fixed mark for the vehicle's nose. */
  _horizon(pen, pose, view, matrix, width, height, r) {
    pen.strokeStyle = ink("chosen");
    pen.lineWidth = 1.5 * r;
    const yaw = Math.atan2(view.forward[0], view.forward[1]);
    const ends = [-0.35, 0.35].map((d) => project(matrix, add(view.eye, [500 * Math.sin(yaw + d), 500 * Math.cos(yaw + d), 0]), width, height));
    if (ends[0] && ends[1]) {
      pen.beginPath();
      pen.moveTo(ends[0][0], ends[0][1]);
      pen.lineTo(ends[1][0], ends[1][1]);
      pen.stroke();
    }
    const [x, y] = [width / 2, height / 2];
    pen.strokeStyle = ink("focus");
    pen.lineWidth = 2.5 * r;
    pen.beginPath();
    for (const side of [-1, 1]) {
      pen.moveTo(x + side * 34 * r, y);
      pen.lineTo(x + side * 14 * r, y);
      pen.lineTo(x + side * 9 * r, y + 6 * r);
    }
    pen.stroke();
  }
}

/** How far the first two fingers are apart. */
function spanOf(held) {
  const [a, b] = [...held.values()];
  return b ? Math.max(1, Math.hypot(a[0] - b[0], a[1] - b[1])) : 1;
}

function crossed(a, b, half) {
  const [x, y] = [b[0] - a[0], b[1] - a[1]];
  const length = Math.hypot(x, y) || 1;
  return [(-y / length) * half, (x / length) * half, 0];
}
