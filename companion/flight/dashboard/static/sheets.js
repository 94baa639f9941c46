// The maps in the browser: blocks fetched when they are in view, painted once, at a level that fits the screen.

import { paint } from "./paint.js";
import { theme } from "./theme.js";

const HEAD_BYTES = 48;
const AT_ONCE = 3;
const LEAST_AGE_MS = 2000; // a block that changes each second is fetched less often than that
const MOST_BLOCKS = 220;
export const GROUND = "ground"; // shown in place of a layer: shaded, coloured by height

/** Decode a block of the height and these layers: see companion/flight/dashboard/map_block.py. */
export function decode(buffer, names) {
  const view = new DataView(buffer);
  const side = view.getUint32(4, true);
  const [west, south, cell, base, step] = [8, 16, 24, 32, 40].map((at) => view.getFloat64(at, true));
  const n = side * side;
  const bytes = new Uint8Array(buffer, HEAD_BYTES);
  const height = new Float32Array(n);
  for (let row = 0, i = 0; row < side; row++) {
    let number = 0;
    for (let col = 0; col < side; col++, i++) {
      number = (number + bytes[i] + (bytes[n + i] << 8)) & 0xffff;
      height[i] = number === 0 ? NaN : base + number * step;
    }
  }
  const planes = Object.fromEntries(names.map((name, k) => [name, bytes.subarray((2 + k) * n, (3 + k) * n)]));
  return { side, west, south, cell, height, planes };
}

class Sheet {
  constructor(name) {
    this.name = name;
    this.head = null;
    this.versions = new Map(); // of the finest blocks
    this.blocks = new Map(); // "level/row/col" -> {data, canvas, version, fetchedAt, usedAt, look}
  }

  take(head, changes) {
    if (!this.head || this.head.serial !== head.serial) {
      this.versions.clear();
      this.blocks.clear();
    }
    this.head = head;
    for (const [row, col, version] of changes) this.versions.set(`${row}/${col}`, version);
  }

  /** Newest version under a block of a level, 0 where nothing is known. */
  version(level, row, col) {
    const many = 1 << level;
    let newest = 0;
    for (let r = row * many; r < (row + 1) * many; r++) {
      for (let c = col * many; c < (col + 1) * many; c++) {
        const version = this.versions.get(`${r}/${c}`);
        if (version > newest) newest = version;
      }
    }
    return newest;
  }

  /** Level whose cells are not much smaller than a pixel. */
  level(metresPerPixel) {
    const level = Math.floor(Math.log2(Math.max(1, (1.2 * metresPerPixel) / this.head.cell_m)));
    return Math.min(this.head.levels - 1, Math.max(0, level));
  }

  /** Keys of the blocks of a level that touch a box and hold something. */
  *over(level, west, south, east, north) {
    const size = this.head.side * this.head.cell_m * 2 ** level;
    const row0 = Math.floor((south - this.head.south_m) / size);
    const row1 = Math.floor((north - this.head.south_m) / size);
    const col0 = Math.floor((west - this.head.west_m) / size);
    const col1 = Math.floor((east - this.head.west_m) / size);
    if ((row1 - row0 + 1) * (col1 - col0 + 1) > 400) return;
    for (let row = row0; row <= row1; row++) {
      for (let col = col0; col <= col1; col++) {
        const version = this.version(level, row, col);
        if (version) yield { level, row, col, version, size, key: `${level}/${row}/${col}` };
      }
    }
  }
}

export class Sheets {
  constructor(onChange) {
    this.sheets = { far: new Sheet("far"), near: new Sheet("near") };
    this._onChange = onChange;
    this._busy = 0;
    this._wanted = new Map();
    this.layers = []; // as the server describes them, the height first
    this.layer = GROUND;
  }

  /** The layer that is shown, null for the ground. */
  get shown() {
    return this.layers.find(({ name }) => name === this.layer) ?? null;
  }

  take(message) {
    for (const [name, changes] of Object.entries(message.changes)) {
      if (message.heads[name]) this.sheets[name].take(message.heads[name], changes);
    }
    this._onChange();
  }

  /** Forget what this channel was told: a new one tells all of it again. */
  restart() {
    for (const sheet of Object.values(this.sheets)) sheet.versions.clear();
  }

  /** Forget the maps of another run of the page's server, which may bear the same numbers. */
  serve(serving) {
    if (this._serving !== undefined && this._serving !== serving) {
      for (const name of Object.keys(this.sheets)) this.sheets[name] = new Sheet(name);
    }
    this._serving = serving;
  }

  /** Blocks to draw in a box, the coarse map first; what is missing is fetched. */
  view(west, south, east, north, metresPerPixel) {
    const found = [];
    for (const sheet of Object.values(this.sheets)) {
      if (!sheet.head) continue;
      const level = sheet.level(metresPerPixel);
      const middle = [(west + east) / 2, (south + north) / 2];
      for (const place of sheet.over(level, west, south, east, north)) {
        const block = this._held(sheet, place, middle) ?? this._coarser(sheet, place);
        if (block) found.push(block);
      }
    }
    this._fetchSome();
    return found;
  }

  /** One sheet's blocks of a level in a box, with their data; for the view in space. */
  data(name, level, west, south, east, north) {
    const sheet = this.sheets[name];
    if (!sheet.head) return [];
    const middle = [(west + east) / 2, (south + north) / 2];
    const found = [];
    for (const place of sheet.over(level, west, south, east, north)) {
      const block = this._held(sheet, place, middle);
      if (block) found.push(block);
    }
    this._fetchSome();
    return found;
  }

  /** Tell whether the near map knows the ground at a point. */
  isNear(east, north) {
    return [...this.sheets.near.blocks.values()].some(({ data }) => {
      if (!data) return false;
      const [col, row] = [Math.floor((east - data.west) / data.cell), Math.floor((north - data.south) / data.cell)];
      return Math.min(row, col) >= 0 && Math.max(row, col) < data.side && Number.isFinite(data.height[row * data.side + col]);
    });
  }

  /** The picture of a block in the layer that is shown now. */
  picture(block) {
    const look = `${this.layer} ${theme()}`;
    if (block.look !== look || block.painted !== block.data) {
      block.canvas = paint(block.data, this.shown, block.canvas, block.sheet === "far");
      block.look = look;
      block.painted = block.data;
    }
    return block.canvas;
  }

  _held(sheet, place, middle) {
    const now = performance.now();
    let block = sheet.blocks.get(place.key);
    if (!block) {
      block = { data: null, version: 0, fetchedAt: -Infinity, sheet: sheet.name, ...place, version: 0 };
      sheet.blocks.set(place.key, block);
      this._forgetOld(sheet);
    }
    block.usedAt = now;
    if (block.version !== place.version && now - block.fetchedAt > LEAST_AGE_MS) {
      const [e, n] = [sheet.head.west_m + (place.col + 0.5) * place.size, sheet.head.south_m + (place.row + 0.5) * place.size];
      const distance = Math.hypot(e - middle[0], n - middle[1]) / place.size;
      this._wanted.set(`${sheet.name}/${place.key}`, { sheet, place, block, urgency: block.data ? 2 + distance : distance });
    }
    return block.data ? block : null;
  }

  /** While a block is on its way, the coarser one over it will do. */
  _coarser(sheet, place) {
    for (let up = 1; up < 4; up++) {
      const block = sheet.blocks.get(`${place.level + up}/${place.row >> up}/${place.col >> up}`);
      if (block?.data) return block;
    }
    return null;
  }

  _fetchSome() {
    const wanted = [...this._wanted.values()].sort((a, b) => a.urgency - b.urgency);
    this._wanted.clear();
    for (const item of wanted.slice(0, AT_ONCE - this._busy)) this._fetch(item);
  }

  async _fetch({ sheet, place, block }) {
    block.fetchedAt = performance.now();
    this._busy++;
    try {
      const { serial } = sheet.head;
      const answer = await fetch(`/map/${sheet.name}/${serial}/${place.key}`);
      if (answer.status === 200 && sheet.head.serial === serial) {
        block.data = decode(await answer.arrayBuffer(), this.layers.slice(1).map(({ name }) => name));
        block.version = place.version;
        this._onChange();
      }
    } catch {
      // the channel tells that the companion is away
    } finally {
      this._busy--;
    }
  }

  _forgetOld(sheet) {
    if (sheet.blocks.size <= MOST_BLOCKS) return;
    const oldest = [...sheet.blocks.entries()].sort((a, b) => a[1].usedAt - b[1].usedAt);
    for (const [key] of oldest.slice(0, 20)) sheet.blocks.delete(key);
  }
}
