// The ground in space: each block a mesh with the painted map and the zones draped over it.

import { program } from "./gl.js";
import { theme } from "./theme.js";
import { drawZone, pathOf } from "./zones.js";

const TEXELS = 512;
const PAINT_MS = 900;

const VERTEX = `
in vec4 place; // east, north, up, known
uniform mat4 matrix;
uniform vec3 box; // west, south, size
uniform float lower;
uniform float haze;
out vec2 spot;
out float known;
out float fog;
void main() {
  spot = vec2((place.x - box.x) / box.z, 1.0 - (place.y - box.y) / box.z);
  known = place.w;
  gl_Position = matrix * vec4(place.xy, place.z - lower, 1.0);
  fog = 0.85 * (1.0 - exp(-pow(gl_Position.w / haze, 2.0)));
}`;
const FRAGMENT = `
in vec2 spot;
in float known;
in float fog;
uniform sampler2D picture;
uniform vec3 sky;
out vec4 colour;
void main() {
  if (known < 0.98) discard;
  vec4 ground = texture(picture, spot);
  if (ground.a < 0.5) discard;
  colour = vec4(mix(ground.rgb, sky, fog), 1.0);
}`;

export class Terrain {
  /** stride: cells from one corner of the mesh to the next. */
  constructor(gl, sheets, model, stride) {
    Object.assign(this, { gl, sheets, model, stride });
    this.n = 256 / stride + 1; // corners along the side of a block
    this.program = program(gl, VERTEX, FRAGMENT);
    this.place = gl.getAttribLocation(this.program.made, "place");
    this.meshes = new Map();
    this.indices = gl.createBuffer();
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.indices);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, triangles(this.n), gl.STATIC_DRAW);
    this._canvas = document.createElement("canvas");
    this._canvas.width = this._canvas.height = TEXELS;
  }

  draw(matrix, [east, north], reach, sky) {
    const { gl, program: p } = this;
    this.near = this.sheets.data("near", 1, east - reach, north - reach, east + reach, north + reach);
    const far = this.sheets.data("far", 0, east - 1.6 * reach, north - 1.6 * reach, east + 1.6 * reach, north + 1.6 * reach);
    const blocks = [...far, ...this.near];
    gl.useProgram(p.made);
    gl.uniformMatrix4fv(p.uniforms.matrix, false, matrix);
    gl.uniform3fv(p.uniforms.sky, sky);
    gl.uniform1f(p.uniforms.haze, 2.4 * reach);
    gl.uniform1i(p.uniforms.picture, 0);
    const wanted = new Set();
    for (const block of blocks) {
      const key = `${block.sheet}/${block.key}`;
      wanted.add(key);
      const mesh = this._mesh(key, block);
      mesh.block = block;
      if (!mesh.painted) continue;
      gl.bindTexture(gl.TEXTURE_2D, mesh.texture);
      gl.uniform3f(p.uniforms.box, block.data.west, block.data.south, block.data.side * block.data.cell);
      gl.uniform1f(p.uniforms.lower, block.sheet === "far" ? 0.6 : 0);
      gl.bindVertexArray(mesh.array);
      gl.drawElements(gl.TRIANGLES, 6 * (this.n - 1) ** 2, gl.UNSIGNED_SHORT, 0);
    }
    gl.bindVertexArray(null);
    for (const [key, mesh] of this.meshes) if (!wanted.has(key)) this._drop(key, mesh);
    this._paintOne();
    return blocks.length;
  }

  _mesh(key, block) {
    const { gl } = this;
    let mesh = this.meshes.get(key);
    if (!mesh) {
      mesh = { buffer: gl.createBuffer(), array: gl.createVertexArray(), texture: gl.createTexture(), data: null, paintedAt: -1e9, zones: 0 };
      gl.bindVertexArray(mesh.array);
      gl.bindBuffer(gl.ARRAY_BUFFER, mesh.buffer);
      gl.enableVertexAttribArray(this.place);
      gl.vertexAttribPointer(this.place, 4, gl.FLOAT, false, 0, 0);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.indices);
      gl.bindVertexArray(null);
      this.meshes.set(key, mesh);
    }
    if (mesh.data !== block.data) {
      mesh.data = block.data;
      gl.bindBuffer(gl.ARRAY_BUFFER, mesh.buffer);
      gl.bufferData(gl.ARRAY_BUFFER, vertices(block.data, this.n, this.stride), gl.DYNAMIC_DRAW);
    }
    return mesh;
  }

  /** Paint what would show the past as the present at once, else one block whose ground or zones changed, each once a second at most. */
  _paintOne() {
    const now = performance.now();
    const look = `${this.model.isPast("verdict")}/${theme()}`;
    const zones = `${this.model.zones?.number}/${look}/${this.model.picked?.zone?.id}/${this.sheets.layer}`;
    for (const mesh of this.meshes.values()) {
      if (mesh.painted && mesh.look !== look) this._paint(mesh, mesh.block, zones, now);
      mesh.look = look;
    }
    const due = [...this.meshes.values()].filter(
      (mesh) => (mesh.painted !== mesh.block.data || mesh.zones !== zones) && now - mesh.paintedAt > PAINT_MS,
    );
    if (!due.length) return;
    const mesh = due.reduce((a, b) => (b.paintedAt < a.paintedAt ? b : a));
    this._paint(mesh, mesh.block, zones, now);
  }

  _paint(mesh, block, zones, now) {
    Object.assign(mesh, { painted: block.data, zones, paintedAt: now });
    const pen = this._canvas.getContext("2d");
    const { west, south, side, cell } = block.data;
    const k = TEXELS / (side * cell);
    pen.clearRect(0, 0, TEXELS, TEXELS);
    pen.imageSmoothingEnabled = true;
    pen.drawImage(this.sheets.picture(block), 0, 0, TEXELS, TEXELS);
    const place = (east, north) => [(east - west) * k, TEXELS - (north - south) * k];
    pen.globalCompositeOperation = "destination-out"; // no ground twice: the near map knows it better
    for (const near of block.sheet === "far" ? this.near : []) {
      const span = near.data.side * near.data.cell;
      pen.drawImage(this.sheets.picture(near), ...place(near.data.west, near.data.south + span), span * k, span * k);
    }
    pen.globalCompositeOperation = "source-atop"; // only where there is ground
    for (const zone of block.sheet === "far" ? this.model.far() : this.model.near()) {
      const look = { far: block.sheet === "far", chosen: this.model.picked?.zone?.id === zone.id, width: Math.max(1.5, 0.3 * k), scale: 1 };
      drawZone(pen, pathOf(zone, place), zone, look);
    }
    pen.globalCompositeOperation = "source-over";
    const { gl } = this;
    gl.bindTexture(gl.TEXTURE_2D, mesh.texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, this._canvas);
    gl.generateMipmap(gl.TEXTURE_2D);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
  }

  _drop(key, mesh) {
    const { gl } = this;
    gl.deleteBuffer(mesh.buffer);
    gl.deleteVertexArray(mesh.array);
    gl.deleteTexture(mesh.texture);
    this.meshes.delete(key);
  }
}

/** Corners every few cells, the last column and row at the block's edge. */
function vertices({ side, west, south, cell, height }, n, stride) {
  const out = new Float32Array(4 * n * n);
  for (let row = 0, at = 0; row < n; row++) {
    const r = Math.min(side - 1, stride * row);
    for (let col = 0; col < n; col++, at += 4) {
      const c = Math.min(side - 1, stride * col);
      const h = nearest(height, side, r, c);
      out[at] = west + stride * col * cell;
      out[at + 1] = south + stride * row * cell;
      out[at + 2] = h === h ? h : 0;
      out[at + 3] = h === h ? 1 : 0;
    }
  }
  // Where nothing is known, stand as high as a known neighbour, so that edges do not hang.
  for (let i = 0; i < n * n; i++) {
    if (out[4 * i + 3]) continue;
    for (const j of [i - 1, i + 1, i - n, i + n]) if (out[4 * j + 3]) out[4 * i + 2] = out[4 * j + 2];
  }
  return out;
}

function nearest(height, side, row, col) {
  const h = height[row * side + col];
  if (h === h) return h;
  for (const [r, c] of [[row, col - 1], [row - 1, col], [row - 1, col - 1], [row, col + 1], [row + 1, col]]) {
    if (r >= 0 && c >= 0 && r < side && c < side && height[r * side + c] === height[r * side + c]) return height[r * side + c];
  }
  return NaN;
}

function triangles(n) {
  const out = new Uint16Array(6 * (n - 1) * (n - 1));
  for (let row = 0, at = 0; row < n - 1; row++) {
    for (let col = 0; col < n - 1; col++) {
      const i = row * n + col;
      out.set([i, i + 1, i + n, i + 1, i + n + 1, i + n], at);
      at += 6;
    }
  }
  return out;
}
