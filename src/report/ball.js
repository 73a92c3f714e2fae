"use strict";
// A ball: its path, the string's length, the error over the string's directions and over time.
const Ball = (() => {
  const { finite, number, px, text, segment, box, disc, svg, rangeOf, width, ticks, colour, ends, minus, axes } = Strokes;
  const { Axis } = Time;

  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const points = (column) => column && column.x.map((x, k) => ([x, column.y[k], column.z[k]].every(finite) ? [x, column.y[k], column.z[k]] : null));
  const between = (a, b) => (a && b ? a.map((v, c) => v - b[c]) : null);

  // First row and one past the last of each window.
  function windows(b) {
    const out = [];
    b.time.forEach((t, k) => {
      if (k === 0 || b.window[k] !== b.window[k - 1] || b.run[k] !== b.run[k - 1]) out.push([k, k]);
      out[out.length - 1][1] = k + 1;
    });
    return out;
  }

  // Runs one after the other, a gap before each window.
  function ballAxis(b) {
    const pause = 0.2;  // between runs [s]: it shows, and is a third of a short flight
    const axis = new Axis();
    axis.offset = new Map();
    for (const [from, to] of windows(b)) {
      const run = b.run[from];
      if (!axis.offset.has(run)) axis.offset.set(run, axis.time.length ? axis.last() + pause - b.time[from] : 0);
      const at = axis.offset.get(run);
      axis.gapBefore(b.time[from] + at);
      for (let k = from; k < to; k++) axis.put(b.time[k] + at, k);
    }
    return axis;
  }

  // Stretches at which the string is taut. Those that a chart cannot show apart are one.
  function tautSpans(b, axis) {
    const out = [], least = 1e-3 * width(ends(axis.time));
    let inside = false;
    axis.row.forEach((row, i) => {
      const taut = row >= 0 && b.taut[row], t = axis.time[i];
      if (taut && !inside && !(out.length && t - out[out.length - 1][1] <= least)) out.push([t, t]);
      if (taut) out[out.length - 1][1] = t;
      inside = taut;
    });
    return out;
  }

  // The distance from where the string is tied (joint `length`), and errors [mm] of it while it is taut, or along x, y, z.
  function chart(d, page, lines) {
    const b = page.series.ball, ball = page.result.ball, axis = ballAxis(b), ofLength = d.joint === "length";
    const flags = ball.flagged.map((f) => f.time + (axis.offset.has(f.run) ? axis.offset.get(f.run) : NaN));
    const anchor = points(b.anchor);
    const column = (name) => {
      if (!ofLength) return axis.pick(b[name][d.joint]);
      return axis.pick(points(b[name]).map((p, k) => (p && anchor[k] ? Math.hypot(...between(p, anchor[k])) : null)));
    };
    const [measured, nominal, fitted] = ["measured", "base", "extended"].map(column);
    if (d.part === "value") return { time: axis.time, unit: "m", lines: lines({ measured, nominal, fitted }), spans: tautSpans(b, axis), level: ball.length, flags };
    const error = (model) => minus(measured, model).map((e, i) => (e === null || (ofLength && !b.taut[axis.row[i]]) ? null : 1e3 * e));
    return { time: axis.time, unit: "mm", lines: lines({ nominal: error(nominal), fitted: error(fitted) }), band: finite(ball.sigma) ? 2e3 * ball.sigma : NaN, flags };
  }

  // Some windows of the path, spread over the series: of each line a list of windows, each a list of points.
  function pathInSpace(d, page) {
    const b = page.series.ball, all = windows(b), most = Math.min(Number(d.windows), all.length), rows = [];
    let left = 1600;  // points of each line
    for (let i = 0; i < most; i++) {
      const [from, to] = all[Math.floor(((2 * i + 1) * all.length) / (2 * most))];
      const stride = Math.max(1, Math.ceil((to - from) / Math.min(800, Math.floor(left / (most - i)))));
      rows.push(Array.from({ length: Math.ceil((to - from) / stride) }, (_, k) => from + k * stride));
      left -= Math.min(left, rows[i].length);
    }
    const out = {}, put = (css, column) => {
      const all = points(column);
      if (all) out[css] = rows.map((list) => list.map((k) => all[k]));
    };
    put("anchor", b.anchor);
    put("measured", b.measured);
    if (!("one" in d)) put("nominal", b.base);
    put("fitted", b.extended);
    return out;
  }

  const coordinate = (paths, c) => paths.flat().map((p) => (p ? p[c] : NaN));

  // Views from the front, the side and above, in one scale. A base model that flies off ends at the frame.
  function space(d, page) {
    const lines = pathInSpace(d, page);
    const seen = axes.map((_, c) => rangeOf(...["measured", "fitted", "anchor"].filter((n) => lines[n]).map((n) => coordinate(lines[n], c))));
    const widest = Math.max(1e-3, ...seen.map(width).filter(finite));
    const ranges = seen.map(([low, high], c) => {
      const near = coordinate(lines.nominal || [], c).filter((x) => x > low - 0.25 * widest && x < high + 0.25 * widest);
      const [from, to] = low <= high ? rangeOf([low, high], near) : [0, 0];
      const margin = Math.max(0.04 * widest, 0.5 * (0.25 * widest - (to - from)));
      return [from - margin, to + margin];
    });
    const views = [["from the front (x, z)", 0, 2], ["from the side (y, z)", 1, 2], ["from above (x, y)", 0, 1]];
    const [left, top, bottom, gap] = [46, 22, 34, 8];
    const wide = views.reduce((sum, v) => sum + width(ranges[v[1]]), 0), high = Math.max(...views.map((v) => width(ranges[v[2]])));
    const scale = Math.min((900 - 3 * (left + gap)) / wide, 340 / high);
    const room = (length, spacing) => (length > 3 * spacing ? Math.floor(length / spacing) : 3);
    let out = "", from = 0;
    for (const [title, across, up] of views) {
      const [rx, ry] = [ranges[across], ranges[up]], [w, h] = [scale * width(rx), scale * width(ry)];
      from += left;
      const at = { x: (v) => from + scale * (v - rx[0]), y: (v) => top + h - scale * (v - ry[0]) };
      for (const t of ticks(rx, room(w, 60))) out += segment("grid", at.x(t), top, at.x(t), top + h) + text(at.x(t), top + h + 14, "middle", number(t));
      for (const t of ticks(ry, room(h, 45))) out += segment("grid", from, at.y(t), from + w, at.y(t)) + text(from - 4, at.y(t) + 4, "end", number(t));
      out += text(from, top - 8, "start", title) + text(from + w, top + h + 28, "end", "m");
      const inside = (p) => p && p[across] > rx[0] && p[across] < rx[1] && p[up] > ry[0] && p[up] < ry[1];
      for (const [css, paths] of Object.entries(lines)) {
        const strokes = paths.map((list) => list.map((p, k) => (inside(p) ? (k && inside(list[k - 1]) ? "L" : "M") + px(at.x(p[across])) + " " + px(at.y(p[up])) : "")).join(""));
        out += `<path class="${css}" d="${strokes.join("")}"/>`;
      }
      from += w + gap;
    }
    return svg("space", 900, top + scale * high + bottom, out);
  }

  // A unit vector in the equal-area map: straight down in the middle, straight up at distance 2 (Lambert 1772).
  function mapped(u) {
    const s = Math.sqrt(2 / Math.max(1 - u[2], 1e-9));
    return [u[0] * s, u[1] * s];
  }

  const cells = 21;  // of the map, from side to side

  // Mean error in each cell, along the string and across it (in the map), and their rms [m].
  function meanErrors(directions, errors, radius) {
    const map = Array.from({ length: cells * cells }, () => ({ along: 0, x: 0, y: 0, rows: 0 })), total = { along: 0, across: 0, rows: 0 };
    directions.forEach((u, k) => {
      const e = errors[k];
      if (!u || !e) return;
      const along = dot(u, e), across = e.map((v, c) => v - along * u[c]), size = Math.hypot(...across), at = mapped(u);
      const index = (v) => Math.min(Math.max(Math.floor((v / radius + 1) * 0.5 * cells), 0), cells - 1);
      const cell = map[index(at[1]) * cells + index(at[0])];
      cell.along += along;
      if (size > 0) {  // its direction in the map, by a small step
        const next = u.map((v, c) => v + (1e-4 * across[c]) / size), r = Math.hypot(...next), to = mapped(next.map((v) => v / r));
        const [dx, dy] = [to[0] - at[0], to[1] - at[1]], far = Math.hypot(dx, dy);
        cell.x += (size * dx) / far;
        cell.y += (size * dy) / far;
      }
      cell.rows++;
      total.rows++;
      total.along += along * along;
      total.across += size * size;
    });
    for (const c of map) if (c.rows) [c.along, c.x, c.y] = [c.along / c.rows, c.x / c.rows, c.y / c.rows];
    const rms = (sum) => Math.sqrt(sum / Math.max(total.rows, 1));
    return { map, along: rms(total.along), across: rms(total.across) };
  }

  // A round number that most of the values do not exceed: 1, 2 or 5 times a power of ten.
  function roundScale(values) {
    const sorted = values.filter(finite).sort((a, b) => a - b);
    if (!sorted.length) return 1e-3;
    const most = Math.max(sorted[Math.floor(((sorted.length - 1) * 95) / 100)], 1e-6), power = 10 ** Math.floor(Math.log10(most));
    return power * ([1, 2, 5].find((step) => most <= step * power) || 10);
  }

  function arrow(x, y, dx, dy) {
    const length = Math.hypot(dx, dy), head = Math.min(3.5, 0.5 * length), [ux, uy] = [dx / length, dy / length];
    if (!(length > 1)) return "";
    const end = px(x + dx) + " " + px(y + dy), side = (s) => px(x + dx - head * (ux - s * uy)) + " " + px(y + dy - head * (uy + s * ux));
    return `M${px(x)} ${px(y)}L${end}M${side(0.6)}L${end}L${side(-0.6)}`;
  }

  // Mean error along (colour) and across (arrows) the string over its direction.
  function sphere(d, page) {
    const b = page.series.ball, [size, top, margin] = [330, 34, 18], mm = (x) => number(1e3 * x, 3);
    const measured = points(b.measured), anchor = points(b.anchor);
    const directions = measured.map((p, k) => {
      const v = between(p, anchor[k]), r = v && Math.hypot(...v);
      return r > 0 ? v.map((x) => x / r) : null;
    });
    const known = directions.filter(Boolean);
    if (!known.length) return "";
    const radius = Math.min(Math.max(1.05 * Math.max(...known.map((u) => Math.hypot(...mapped(u)))), 0.05), 2);
    const panel = (title, model) => ({ title, ...meanErrors(directions, points(model).map((p, k) => between(measured[k], p)), radius) });
    const panels = ["one" in d ? null : panel(d.before, b.base), panel(d.after, b.extended)].filter(Boolean);
    const least = known.length < 400 ? 1 : 3;  // rows that a cell's mean needs
    const used = panels.flatMap((p) => p.map).filter((c) => c.rows >= least);
    if (!used.length) return "";
    const full = roundScale(used.map((c) => Math.abs(c.along))), longArrow = roundScale(used.map((c) => Math.hypot(c.x, c.y)));
    const fill = (share) => colour(share, [0, 90, 160], [205, 80, 0], [250, 250, 250]);
    const cell = size / cells, arrowScale = (1.5 * cell) / longArrow;
    let out = "", left = margin;
    for (const p of panels) {
      const [cx, cy, scale] = [left + size / 2, top + size / 2, size / 2 / radius];
      out += text(cx, 12, "middle", p.title) + text(cx, 26, "middle", `rms along the string ${mm(p.along)} mm, across it ${mm(p.across)} mm`);
      let arrows = "";
      p.map.forEach((c, k) => {
        if (c.rows < least) return;
        const x = left + (k % cells) * cell, y = top + (cells - 1 - Math.floor(k / cells)) * cell, length = Math.hypot(c.x, c.y);
        out += box("cell", x, y, cell, cell, fill(c.along / full));
        // Length that noise alone exceeds in 5 % of the cells: mean of n vectors of two coordinates, in σ/√n (Rayleigh).
        if (length * Math.sqrt(c.rows) < 2.45 * page.result.ball.sigma) return;
        const shown = (length > 0 ? Math.min(length, 2 * longArrow) / length : 0) * arrowScale, [dx, dy] = [c.x * shown, -c.y * shown];
        arrows += arrow(x + (cell - dx) / 2, y + (cell - dy) / 2, dx, dy);
      });
      for (const degrees of [15, 30, 45, 60, 90, 120, 150]) {
        const r = 2 * Math.sin((degrees * Math.PI) / 360);
        if (r > radius || (degrees % 30 === 15 && radius > 1.1)) continue;
        out += disc("around", [cx, cy], px(r * scale)) + text(cx + 0.7071 * r * scale + 2, cy - 0.7071 * r * scale - 2, "start", degrees + "°");
      }
      out += segment("zero", cx - size / 2, cy, cx + size / 2, cy) + segment("zero", cx, cy - size / 2, cx, cy + size / 2) + text(cx + size / 2 + 3, cy + 4, "start", "x") + text(cx + 4, cy - size / 2 + 8, "start", "y");
      out += `<path class="arrow" d="${arrows}"/>`;
      left += size + 2 * margin;
    }
    const x = left + 14, bar = 160, from = top + 40, steps = 20;  // the scales
    out += text(x, from - 22, "start", "mean along the string") + text(x, from - 8, "start", "[mm]");
    for (let k = 0; k < steps; k++) out += box("cell", x, from + (k * bar) / steps, 14, bar / steps, fill(1 - (2 * k + 1) / steps));
    out += text(x + 20, from + 6, "start", `+${mm(full)} ball farther`) + text(x + 20, from + bar / 2 + 4, "start", "0") + text(x + 20, from + bar + 2, "start", `−${mm(full)} ball nearer`);
    out += text(x, from + bar + 36, "start", "mean across it") + `<path class="arrow" d="${arrow(x, from + bar + 50, longArrow * arrowScale, 0)}"/>` + text(x + longArrow * arrowScale + 6, from + bar + 54, "start", mm(longArrow) + " mm");
    return svg("sphere", 900, top + size + 12, out);
  }

  return { chart, pathInSpace, space, sphere };
})();
