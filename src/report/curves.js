"use strict";
// Curves with bands, means in bins, maps, bars, points.
const Curves = (() => {
  const { finite, number, unit, withUnit, px, text, segment, box, disc, svg, rangeOf, width, widened, ticks, path, frame, margins, grid, colour, ends, minus } = Strokes;

  // --- means in bins, with bands

  // Means of y in bins of equally many x. Samples of one stay in a bin are not independent, stays are: the 95 %
  // interval is that of clusters (Liang, Zeger 1986); NaN where a single stay makes up the bin.
  function binned(x, y, bins) {
    const good = (k) => finite(x[k]) && finite(y[k]);
    const sorted = x.filter((v, k) => good(k)).sort((a, b) => a - b);
    const each = Math.max(Math.floor(sorted.length / bins), 1), upper = [];
    for (let k = each; k <= sorted.length && upper.length < bins; k += each) if (!upper.length || sorted[k - 1] > upper[upper.length - 1]) upper.push(sorted[k - 1]);
    if (!upper.length) return [];
    upper[upper.length - 1] = sorted[sorted.length - 1];
    const binOf = (k) => (good(k) ? upper.findIndex((u) => x[k] <= u) : -1);
    const out = upper.map(() => ({ x: 0, mean: 0, count: 0, squares: 0, stays: 0 }));
    const place = x.map((v, k) => binOf(k));
    place.forEach((b, k) => {
      if (b < 0) return;
      out[b].x += x[k];
      out[b].mean += y[k];
      out[b].count++;
    });
    for (const b of out) [b.x, b.mean] = [b.x / b.count, b.mean / b.count];
    for (let k = 0; k < x.length; ) {
      const b = place[k];
      let sum = 0;
      do {
        sum += b < 0 ? 0 : y[k] - out[b].mean;
        k++;
      } while (k < x.length && place[k] === b);
      if (b < 0) continue;
      out[b].squares += sum * sum;
      out[b].stays++;
    }
    for (const b of out) b.half = b.stays < 2 ? NaN : (1.96 * Math.sqrt((b.squares * b.stays) / (b.stays - 1))) / b.count;
    return out;
  }

  // Error over velocity, which shows a friction that is described wrongly.
  function velocity(d, page) {
    const s = page.series[d.set][d.joint], bins = binned(s.velocity, minus(s.fitted, s.measured), 24);
    const size = [900, 150];
    const rx = widened(rangeOf(bins.map((b) => b.x)), 0.02);
    const ry = widened(rangeOf([0], ...bins.map((b) => [b.mean, b.mean - b.half, b.mean + b.half])), 0.05);
    const at = frame(rx, ry, size, margins);
    let out = grid(at, rx, ry, size, { below: s.unit === "N" ? "m/s" : "rad/s", above: "error " + unit(s.unit) }) + segment("prior", at.left, at.y(0), at.right, at.y(0));
    for (const b of bins) {
      if (finite(b.half)) out += segment("spread", at.x(b.x), at.y(b.mean - b.half), at.x(b.x), at.y(b.mean + b.half));
      out += disc("mean", [at.x(b.x), at.y(b.mean)], 3);
    }
    return svg("binned", ...size, out);
  }

  // Means over anything, with bands of their intervals and the zero line. @param mark  a place on x to point at
  function bandChart(x, curves, titles, mark) {
    const size = [450, 230];
    const rx = widened(rangeOf(x), 0.02);
    const ry = widened(rangeOf([0], ...curves.flatMap((c) => [c.mean, c.low || [], c.high || []])), 0.06);
    const at = frame(rx, ry, size, [52, 8, 20, 38]);
    let out = "";
    for (const t of ticks(ry, 5)) out += segment("grid", at.left, at.y(t), at.right, at.y(t)) + text(at.left - 5, at.y(t) + 4, "end", number(t));
    for (const t of ticks(rx, 6)) out += segment("grid", at.x(t), at.bottom, at.x(t), at.bottom + 4) + text(at.x(t), at.bottom + 16, "middle", number(t));
    out += segment("zero", at.left, at.y(0), at.right, at.y(0));
    if (finite(mark) && mark > rx[0] && mark < rx[1]) out += segment("mark", at.x(mark), at.top, at.x(mark), at.bottom);
    out += text((at.left + size[0]) / 2, size[1] - 4, "middle", titles[0]) + text(4, at.top - 8, "start", titles[1]);
    for (const c of curves) {  // stretches of finite intervals
      for (let k = 0; c.low && k < x.length; k++) {
        const begin = k;
        while (k < x.length && finite(c.low[k]) && finite(c.high[k])) k++;
        if (k < begin + 2) continue;
        const corner = (y) => (v, i) => px(at.x(v)) + "," + px(at.y(y[begin + i]));
        const along = x.slice(begin, k);
        out += `<polygon class="${c.css}" points="${[...along.map(corner(c.high)), ...along.map(corner(c.low)).reverse()].join(" ")}"/>`;
      }
    }
    for (const c of curves) out += `<path class="${c.css}" d="${path(x, c.mean, at, 1e-3)}"/>`;
    return svg("band", ...size, out);
  }

  function evidence(d, page) {
    const p = page.series.plots[d.index];
    const curves = p.curves.map((c) => ({ ...c, css: c.model === "base" ? "nominal" : "fitted" }));
    return bandChart(p.x, curves, [withUnit(p.x_name, p.x_unit), withUnit(p.y_name, p.y_unit)], p.mark);
  }

  // Error over the length of simulated windows, both on scales of equal ratios. @param curves  [css, y]
  // @param level  a tolerance, drawn across
  function overHorizon(horizons, curves, title, level) {
    const size = [450, 230], log = (v) => (v > 0 ? Math.log10(v) : NaN), across = log(level);
    const x = horizons.map(log), all = curves.map(([css, y]) => [css, y.map(log)]);
    const rx = widened(rangeOf(x), 0.04), ry = widened(rangeOf(...all.map((c) => c[1].filter(finite)), finite(across) ? [across] : []), 0.08);
    const at = frame(rx, ry, size, [52, 8, 20, 38]);
    const decades = (r) => Array.from({ length: Math.floor(r[1]) - Math.floor(r[0]) + 1 }, (_, k) => Math.floor(r[0]) + k).flatMap((k) => (width(r) > 2.5 ? [1] : [1, 2, 5]).map((m) => k + Math.log10(m))).filter((t) => t > r[0] && t < r[1]);
    let out = "";
    for (const t of decades(ry)) out += segment("grid", at.left, at.y(t), at.right, at.y(t)) + text(at.left - 5, at.y(t) + 4, "end", number(10 ** t));
    for (const t of decades(rx)) out += segment("grid", at.x(t), at.bottom, at.x(t), at.bottom + 4) + text(at.x(t), at.bottom + 16, "middle", number(10 ** t));
    out += text((at.left + size[0]) / 2, size[1] - 4, "middle", "horizon [s]") + text(4, at.top - 8, "start", title);
    if (finite(across)) out += segment("mark", at.left, at.y(across), at.right, at.y(across));
    for (const [css, y] of all) out += `<path class="${css}" d="${path(x, y, at, 1e-6)}"/>` + y.map((v, k) => (finite(v) ? disc(css, [at.x(x[k]), at.y(v)], 2.5) : "")).join("");
    return svg("band", ...size, out);
  }

  // An identification: a curve a model.
  function horizon(d, page) {
    const rows = page.result.horizons.filter((h) => h.joint === d.joint);
    const curves = [["nominal", "nominal_" + d.set], ["fitted", d.set]].map(([css, key]) => [css, rows.map((h) => h[key])]);
    return overHorizon(rows.map((h) => h.horizon), curves, `error [${unit(rows[0].unit)}]`, NaN);
  }

  // A diagnosis: one joint, or the worst of all.
  function follows(d, page) {
    const { horizons, joints } = page.result.simulated, j = Number(d.joint), all = d.joint === "all";
    const of = (model) => horizons.map((h) => (all ? h[model] : 1e3 * (h[model + "_rmse"][j] ?? NaN)));
    const curves = ("one" in d ? [["nominal", "base"]] : [["nominal", "base"], ["fitted", "extended"]]).map(([css, model]) => [css, of(model)]);
    return overHorizon(horizons.map((h) => h.horizon), curves, all ? "error over tolerance" : `error [m${joints[j].unit}]`, all ? 1 : 1e3 * joints[j].tolerance);
  }

  // --- a learned torque over one variable, or over two

  function greyBox(d, page) {
    const g = page.series.grey_box[d.index], its = unit(page.result.grey_box[d.index].unit), title = (k) => withUnit(g.variables[k], g.units[k]);
    if (g.at.length === 1) {
      const shifted = (by) => g.torque.map((t, k) => t + by * g.std[k]);
      return bandChart(g.at[0], [{ css: "fitted", mean: g.torque, low: shifted(-1.96), high: shifted(1.96) }], [title(0), `learned [${its}]`]);
    }
    const size = [470, 285], [left, right, top, bottom, legend] = [60, 370, 20, 240, 392];
    const most = Math.max(...g.torque.map(Math.abs)) || 1, [x, y] = g.at;
    const rx = ends(x), ry = ends(y), w = (right - left) / x.length, h = (bottom - top) / y.length;
    const at = frame(rx, ry, size, [left + w / 2, size[0] - right + w / 2, top + h / 2, size[1] - bottom + h / 2]);  // values are in the middle of their cells
    const fill = (torque) => colour(torque / most, [0, 114, 178], [213, 94, 0], [255, 255, 255]);
    const cell = (cx, cy, wide, high, torque) => box("cell", cx, cy, wide + 0.3, high + 0.3, fill(torque));
    let out = "";
    x.forEach((vx, i) => y.forEach((vy, k) => (out += cell(at.x(vx) - w / 2, at.y(vy) - h / 2, w, h, g.torque[i * y.length + k]))));
    for (const t of ticks(rx, 6)) out += segment("grid", at.x(t), bottom, at.x(t), bottom + 4) + text(at.x(t), bottom + 16, "middle", number(t));
    for (const t of ticks(ry, 5)) out += segment("grid", left - 4, at.y(t), left, at.y(t)) + text(left - 6, at.y(t) + 4, "end", number(t));
    const steps = 21, step = (bottom - top) / steps;
    for (let k = 0; k < steps; k++) out += cell(legend, bottom - step * (k + 1), 14, step, most * ((2 * k) / (steps - 1) - 1));
    for (const v of [-most, 0, most]) out += text(legend + 19, (top + bottom) / 2 - (v / most) * 0.5 * (bottom - top - step) + 4, "start", number(v, 2));
    return svg("band", ...size, out + text((left + right) / 2, 278, "middle", title(0)) + text(4, top - 8, "start", title(1)) + text(legend, top - 8, "start", its));
  }

  // --- bars

  // Bars below each other: rows of {css, label, text, from, to}. @param knee  equal steps for equal ratios far above
  // it, for equal differences below it (asinh); a line marks it
  function bars(d) {
    const knee = Number(d.knee), row = 22, wide = 900;
    const labels = Math.min(0.55 * wide, 16 + 6.6 * Math.max(...d.rows.map((r) => r.label.length)));
    const scaled = (v) => (knee ? Math.asinh(v / knee) : v);
    const range = rangeOf([0, knee ? scaled(2 * knee) : 0], d.rows.flatMap((r) => [scaled(r.from), scaled(r.to)]));
    if (!(range[1] > range[0])) range[1] = range[0] + 1;
    const x = (v) => labels + ((scaled(v) - range[0]) / width(range)) * (wide - labels - 170), height = row * d.rows.length + 4;
    let out = segment("zero", x(0), 0, x(0), height) + (knee ? segment("mark", x(knee), 0, x(knee), height) : "");
    d.rows.forEach((r, k) => {
      const y = 4 + row * k, [left, right] = [x(Math.min(r.from, r.to)), x(Math.max(r.from, r.to))];
      if (finite(left) && finite(right)) out += box(r.css, left, y, Math.max(right - left, 0.5), 14) + text(Math.max(right, x(0)) + 6, y + 11, "start", r.text);
      out += text(labels - 8, y + 11, "end", r.label);
    });
    return svg("bars", wide, height, out);
  }

  // One parameter: where it was (tick), where it is (dot), two standard errors to either side (bar).
  function estimate(d) {
    const [prior, value, std] = [d.prior, d.value, d.std].map(Number), spread = finite(std) ? 2 * std : 0;
    const range = widened(rangeOf([value - spread, value + spread, prior]), 0.1), x = (v) => 4 + (172 * (v - range[0])) / width(range);
    let out = range[0] < 0 && range[1] > 0 ? segment("grid", x(0), 0, x(0), 14) : "";
    if (finite(prior)) out += segment("prior", x(prior), 1, x(prior), 13);
    if (spread > 0) out += segment("spread", x(value - spread), 7, x(value + spread), 7);
    return svg("bar", 180, 14, out + (finite(value) ? disc("mean", [x(value), 7], 3) : ""));
  }

  // --- searches and executions

  // One number of all seeds over iterations; the best policy's is drawn boldly.
  function curve(d, page) {
    const all = page.result.policies.map((p) => p.curve[d.key]), longest = Math.max(...all.map((y) => y.length)), best = Number(d.best);
    const curves = all.map((mean, k) => ({ css: k === best ? "fitted" : "seed", mean })).sort((a, b) => (a.css === "fitted") - (b.css === "fitted"));
    if (finite(Number(d.bound))) curves.push({ css: "bound", mean: Array(longest).fill(Number(d.bound)) });
    return bandChart(Array.from({ length: longest }, (_, k) => k + 1), curves, ["iteration", d.unit]);
  }

  // Obtained against expected reward, a point a policy.
  function scatter(d, page) {
    const executed = page.result.policies, [size, left, bottom, top] = [380, 52, 36, 12], side = size - bottom - top;
    const range = widened(rangeOf(executed.flatMap((p) => [p.expected, p.reward])), 0.08);
    const at = frame(range, range, [left + side + 12, size], [left, 12, top, bottom]);
    let out = "";
    for (const t of ticks(range, 5)) out += segment("grid", left, at.y(t), left + side, at.y(t)) + segment("grid", at.x(t), top, at.x(t), top + side) + text(left - 5, at.y(t) + 4, "end", number(t)) + text(at.x(t), top + side + 14, "middle", number(t));
    out += segment("zero", at.x(range[0]), at.y(range[0]), at.x(range[1]), at.y(range[1])) + text(left + side / 2, size - 5, "middle", "reward expected in the model") + text(left + 4, top + 10, "start", "reward obtained");
    for (const p of executed) if (finite(p.expected) && finite(p.reward)) out += disc(p.success ? "caught" : "lost", [at.x(p.expected), at.y(p.reward)], 4.5);
    return svg("scatter", left + side + 12, size, out);
  }

  return { velocity, evidence, horizon, follows, greyBox, bars, estimate, curve, scatter };
})();
