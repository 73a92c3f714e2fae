"use strict";
// Parts of all drawings, as SVG text: strokes, texts, round numbers, axes.
const Strokes = (() => {
  const finite = Number.isFinite;

  // --- strokes, texts, round numbers

  const escaped = (words) => String(words).replace(/[&<>"']/g, (c) => `&#${c.charCodeAt(0)};`);
  const number = (x, digits = 4) => (finite(x) ? String(+x.toPrecision(digits)) : "–");
  const unit = (u) => (u === "1" || !u ? "" : u.replace(/\*/g, "·").replace(/\^2/g, "²").replace(/\^3/g, "³"));
  const withUnit = (name, u) => name + (unit(u) ? ` [${unit(u)}]` : "");
  const px = (x) => x.toFixed(1);
  const text = (x, y, anchor, words) => `<text x="${px(x)}" y="${px(y)}" text-anchor="${anchor}">${escaped(words)}</text>`;
  const segment = (name, x1, y1, x2, y2) => `<line class="${name}" x1="${px(x1)}" y1="${px(y1)}" x2="${px(x2)}" y2="${px(y2)}"/>`;
  const box = (name, x, y, w, h, style = "") => `<rect class="${name}" ${style}x="${px(x)}" y="${px(y)}" width="${px(w)}" height="${px(h)}"/>`;
  const disc = (name, [x, y], r) => `<circle class="${name}" cx="${px(x)}" cy="${px(y)}" r="${r}"/>`;
  const stroke = (name, points) => `<path class="${name}" d="${points.map((p, k) => (k ? "L" : "M") + px(p[0]) + " " + px(p[1])).join("")}"/>`;
  const svg = (name, width, height, content) => `<svg class="${name}" viewBox="0 0 ${px(width)} ${px(height)}" role="img">${content}</svg>`;

  function rangeOf(...lists) {
    const range = [Infinity, -Infinity];
    for (const list of lists) {
      for (const v of list) if (finite(v)) [range[0], range[1]] = [Math.min(range[0], v), Math.max(range[1], v)];
    }
    return range;
  }
  const width = (range) => range[1] - range[0];

  // Adds a margin; an empty range becomes 0 to 1.
  function widened([low, high], share) {
    if (!(low <= high)) return [0, 1];
    const margin = high > low ? share * (high - low) : Math.max(0.5 * Math.abs(low), 0.5);
    return [low - margin, high + margin];
  }

  // Round numbers, about `count` of them: steps of 1, 2 or 5 times a power of ten.
  function ticks([low, high], count) {
    const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw)), share = raw / power;
    const step = power * (share < 1.5 ? 1 : share < 3.5 ? 2 : share < 7.5 ? 5 : 10);
    const out = [];
    for (let k = Math.ceil(low / step); k * step <= high && out.length <= 2 * count; k++) out.push(k * step);
    return out;
  }

  // One line, broken where x or y is missing; of the points in one column of pixels the lowest and the highest.
  function path(x, y, at, column) {
    let out = "", drawn = 0;
    const put = (k) => (out += (drawn++ ? "L" : "M") + px(at.x(x[k])) + " " + px(at.y(y[k])));
    const end = () => {
      if (drawn === 1) out += "h0";  // a point by itself is a dot
      drawn = 0;
    };
    const place = (k) => (finite(y[k]) && finite(x[k]) ? Math.floor(at.x(x[k]) / column) : NaN);
    for (let k = 0; k < x.length; ) {
      const here = place(k);
      if (!finite(here)) {
        end();
        k++;
        continue;
      }
      let lowest = k, highest = k;
      for (; k < x.length && place(k) === here; k++) {
        if (y[k] < y[lowest]) lowest = k;
        if (y[k] > y[highest]) highest = k;
      }
      put(Math.min(lowest, highest));
      if (lowest !== highest) put(Math.max(lowest, highest));
    }
    end();
    return out;
  }

  // Maps values to pixels.
  function frame(rx, ry, size, margin) {
    const [wide, high] = size, [left, right, top, bottom] = margin;
    return {
      left, top, right: wide - right, bottom: high - bottom,
      x: (v) => left + ((v - rx[0]) / width(rx)) * (wide - left - right),
      y: (v) => high - bottom - ((v - ry[0]) / width(ry)) * (high - top - bottom),
    };
  }

  const margins = [52, 8, 8, 24];  // left, right, above, below, of what is as wide as the page

  // @param titles  {below, above}: of the axes, inside; {after}: unit of x, at its last number
  function grid(at, rx, ry, size, { below = "", above = "", after = "" }) {
    let out = "";
    for (const t of ticks(ry, Math.max(Math.floor(size[1] / 36), 2))) out += segment("grid", at.left, at.y(t), at.right, at.y(t)) + text(at.left - 5, at.y(t) + 4, "end", number(t));
    ticks(rx, Math.max(Math.floor(size[0] / 112), 2)).forEach((t, k, all) => {
      out += segment("grid", at.x(t), at.top, at.x(t), at.bottom) + text(at.x(t), size[1] - 8, "middle", number(t, 6) + (k === all.length - 1 ? after : ""));
    });
    return out + text(at.right, at.bottom - 4, "end", below) + text(at.left + 4, at.top + 8, "start", above);
  }

  // Blue below 0, white, orange above: colours that the colour-blind tell apart.
  function colour(share, low, high, none) {
    const s = Math.min(Math.abs(share), 1), end = share < 0 ? low : high;
    return `style="fill:rgb(${end.map((v, c) => Math.round(none[c] + s * (v - none[c]))).join(",")})" `;
  }

  const ends = (time) => (time.length ? [time[0], time[time.length - 1]] : [NaN, NaN]);

  const minus = (a, b) => a.map((v, k) => (finite(v) && finite(b[k]) ? v - b[k] : null));

  const axes = ["x", "y", "z"];

  return { finite, escaped, number, unit, withUnit, px, text, segment, box, disc, stroke, svg, rangeOf, width, widened, ticks, path, frame, margins, grid, colour, ends, minus, axes };
})();
