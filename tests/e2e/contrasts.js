// Least contrast of words, zones and outlines of the page, by name, from what its own modules draw: words on what
// is behind them, zones on ground in every light.
(async () => {
  const [{ ink }, { paint }, zones, marks, { FENCE }, { WIRE }, { MOVING }, { WIND }] = await Promise.all(
    ['theme', 'paint', 'zones', 'marks', 'fence', 'wires', 'moving', 'rose'].map((name) => import(`/static/${name}.js`)));
  const pen = new OffscreenCanvas(1, 1).getContext('2d', { willReadFrequently: true });
  const over = (...layers) => {
    for (const layer of layers) { pen.fillStyle = layer; pen.fillRect(0, 0, 1, 1); }
    return [...pen.getImageData(0, 0, 1, 1).data].slice(0, 3);
  };
  const light = (rgb) => rgb.map((c) => c / 255).map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
    .reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0);
  const ratio = (a, b) => { const [x, y] = [light(a), light(b)].sort(); return (y + 0.05) / (x + 0.05); };
  const side = 64, height = new Float32Array(side * side); // slopes to all sides, at all heights
  height.forEach((_, i) => (height[i] = 30 * Math.sin(i / 700) ** 2 + 2 * Math.sin(i / 3) * Math.cos(i / side / 2)));
  const least = {};
  const note = (name, value) => (least[name] = Math.min(least[name] ?? 99, value));
  for (const far of [false, true]) {
    const ground = paint({ side, height, cell: 0.2, planes: {} }, null, undefined, far);
    const pixels = ground.getContext('2d').getImageData(0, 0, side, side).data;
    const soils = [...Array(side * side).keys()].map((i) => [...pixels.slice(4 * i, 4 * i + 3)]).sort((a, b) => light(a) - light(b));
    for (const soil of [soils[0], soils.at(-1)]) {
      for (const beside of [soils[0], soils.at(-1)]) {
        for (const name of ['largest', 'certain', 'uncertain']) {
          const { line, fill } = zones.STYLE[name];
          note(`${name} outline`, ratio(over(line), soil));
          if (!far) note(`${name} fill`, ratio(over(`rgb(${soil})`, fill), beside));
        }
      }
      for (const name of ['text', 'safe', 'unsafe', 'unknown', 'past', 'largest', 'certain', 'uncertain']) {
        note(`text ${name}`, ratio(over(ink(name)), over(`rgb(${soil})`, ink('label'))));
      }
    }
  }
  for (const thing of [FENCE, WIRE, MOVING, WIND, marks.OBSTACLE]) note(`text ${thing.name}`, ratio(over(thing.line), over(thing.halo)));
  const words = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (words.nextNode()) {
    const box = words.currentNode.parentElement;
    if (!words.currentNode.data.trim() || !box.checkVisibility() || box.closest(':disabled, noscript')) continue;
    const layers = [];
    for (let each = box; each; each = each.parentElement) layers.unshift(getComputedStyle(each).backgroundColor);
    const behind = box.closest('.alarm.critical') && box.tagName !== 'BUTTON' ? [over(ink('alarm')), over(ink('alarm2'))] : [over(...layers)];
    for (const each of behind) note(`text "${words.currentNode.data.trim()}"`, ratio(over(...layers, getComputedStyle(box).color), each));
  }
  return least;
})()
