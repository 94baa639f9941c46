// The operator's picture beneath the map from above: tiles of it, fetched when they come into view.

import { byId, el, setText } from "./dom.js";

const [SIDE, UNIT] = [512, 0.1]; // pixels of a tile; cell of level 0 (m): as in background_picture.py
const [AT_ONCE, MOST_TILES, RETRY_MS] = [2, 80, 5000];
export const SHARE = 0.28; // of the picture in what is seen: even over white a zone's outline has a contrast of 3:1

export class Background {
  constructor(model) {
    Object.assign(this, { model, place: null, on: true }); // place: {name, finest, box_m} in the map frame
    this.tiles = new Map(); // "level/row/col" -> image, the one used last at the end
    this._entry = el("div");
    byId("picture").onclick = () => this.update((this.on = !this.on));
  }

  /** Follow the map frame; name the picture, and tell when it lies elsewhere. */
  update() {
    const [path, pose, { place, on }] = [this.model.zones?.frame.join("/"), this.model.pose(), this];
    if (path && path !== this._path) this._find(path);
    byId("picture").hidden = !place;
    byId("picture").setAttribute("aria-pressed", String(on));
    if (place && on) byId("legend").append(this._entry);
    else this._entry.remove();
    setText(this._entry, `picture: ${place?.name}, of unknown date`);
    const [west, south, east, north] = place?.box_m ?? [];
    const here = pose && west < pose.east && pose.east < east && south < pose.north && pose.north < north;
    byId("elsewhere").hidden = !place || !on || !pose || here;
    setText(byId("elsewhere"), `${place?.name} lies elsewhere: the vehicle is outside this picture`);
  }

  async _find(path) {
    [this._path, this.place] = [path, null];
    this.tiles.clear();
    const answer = await fetch(`/background/${path}`).catch(() => null);
    if (path !== this._path) return;
    if (answer?.ok) this.place = await answer.json();
    else setTimeout(() => (this._path = null), RETRY_MS);
  }

  /** Tiles to draw in a box, coarse ones that are held first: [image, west, north, cell]. */
  view(west, south, east, north, metresPerPixel) {
    if (!this.place?.box_m || !this.on) return [];
    const [[w, s, e, n], found] = [this.place.box_m, []];
    const finest = Math.max(this.place.finest, Math.floor(Math.log2((1.2 * metresPerPixel) / UNIT)));
    for (let level = finest + 3; level >= finest; level--) {
      const cell = UNIT * 2 ** level;
      const size = SIDE * cell;
      for (let row = Math.floor(Math.max(s, south) / size); row * size < Math.min(n, north); row++) {
        for (let col = Math.floor(Math.max(w, west) / size); col * size < Math.min(e, east); col++) {
          const tile = this._tile(`${level}/${row}/${col}`, level === finest);
          if (tile?.complete && tile.naturalWidth) found.push([tile, col * size, (row + 1) * size, cell]);
        }
      }
    }
    return found;
  }

  _tile(key, wanted) {
    const tile = this.tiles.get(key) ?? new Image();
    if (!this.tiles.delete(key)) {
      if (!wanted || [...this.tiles.values()].filter(({ complete }) => !complete).length >= AT_ONCE) return null;
      tile.onerror = () => setTimeout(() => this.tiles.delete(key), RETRY_MS);
      tile.src = `/background/${this._path}/${key}`;
    }
    this.tiles.set(key, tile);
    if (this.tiles.size > MOST_TILES) this.tiles.delete(this.tiles.keys().next().value);
    return tile;
  }
}
