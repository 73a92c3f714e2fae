"use strict";
// Charts over time: rows of recordings on one axis, lines in a range of it.
const Time = (() => {
  const { finite, unit, segment, box, svg, rangeOf, widened, path, frame, margins, grid, ends, minus } = Strokes;

  // Rows of a series on one axis of time; row −1 is a gap.
  class Axis {
    constructor() {
      this.time = [];
      this.row = [];
    }
    last() {
      return this.time[this.time.length - 1];
    }
    put(t, row) {
      this.time.push(t);
      this.row.push(row);
    }
    gapBefore(t) {
      if (this.time.length) this.put((this.last() + t) / 2, -1);
    }
    pick(values) {
      return this.row.map((k) => (k < 0 ? null : values[k]));
    }
  }

  // Recordings one after the other; a gap between them and where rows are missing.
  function runsOnOneAxis(s) {
    let step = Infinity, offset = 0;
    for (let k = 1; k < s.time.length; k++) if (s.time[k] > s.time[k - 1]) step = Math.min(step, s.time[k] - s.time[k - 1]);
    const axis = new Axis();
    s.time.forEach((time, k) => {
      let t = time + offset;
      const nextRun = k > 0 && t <= axis.last();
      if (nextRun) {
        offset += axis.last() + 0.04 * (axis.last() - axis.time[0]) - t;
        t = time + offset;
      }
      if (nextRun || (k > 0 && t - axis.last() > 1.5 * step)) axis.gapBefore(t);
      axis.put(t, k);
    });
    return axis;
  }

  // Windows side by side, however far apart they were recorded. One ends where both models have no value.
  function windowsOnOneAxis(s, seconds) {
    const axis = new Axis(), none = (k) => !finite(s.base[k]) && !finite(s.extended[k]);
    let offset = 0, step = 0;
    s.time.forEach((time, k) => {
      const begins = k === 0 || (none(k - 1) && finite(s.base[k]));
      if (k + 1 < s.time.length && !begins) step = time - s.time[k - 1];
      if (begins) {
        const from = k === 0 ? 0 : axis.last() + 0.05 * seconds + step;
        axis.gapBefore(from);
        offset = from - time;
      }
      axis.put(time + offset, k);
    });
    return axis;
  }

  // Contents of a chart over time: {time, lines: [{css, name, y}], unit}; of a ball also spans, level, band and flags.
  function timeChart(d, page) {
    const names = { measured: "measured", nominal: d.before, fitted: d.after };
    const lines = (columns) => Object.entries(columns).filter(([css, y]) => y && !(css === "nominal" && "one" in d)).map(([css, y]) => ({ css, name: names[css], y }));
    if (d.set === "ball") return Ball.chart(d, page, lines);
    const s = page.series[d.set][d.joint];
    const axis = d.set === "simulated" ? windowsOnOneAxis(s, page.result.simulated.window) : runsOnOneAxis(s);
    const [measured, nominal, fitted] = [s.measured, s.nominal || s.base, s.fitted || s.extended].map((y) => axis.pick(y));
    if (d.part === "value") return { time: axis.time, unit: unit(s.unit), lines: lines({ measured, nominal, fitted }) };
    // Signs: measured − model where both models are judged (what they lack), else fitted − measured (the error of a fit).
    const both = "both" in d;
    return {
      time: axis.time,
      unit: unit(s.unit),
      lines: lines({ nominal: both ? minus(measured, nominal) : null, fitted: both ? minus(measured, fitted) : minus(fitted, measured) }),
    };
  }

  // Keeps a range of x; lines end on its borders.
  function cut(x, y, [low, high]) {
    const xs = [], ys = [];
    const border = (k, at) => {
      if (!(k > 0 && x[k - 1] < at && x[k] > at && finite(y[k]) && finite(y[k - 1]))) return;
      xs.push(at);
      ys.push(y[k - 1] + ((y[k] - y[k - 1]) * (at - x[k - 1])) / (x[k] - x[k - 1]));
    };
    for (let k = 0; k < x.length; k++) {
      border(k, low);
      if (x[k] >= low && x[k] <= high) {
        xs.push(x[k]);
        ys.push(y[k]);
      }
      border(k, high);
    }
    return [xs, ys];
  }

  // `range` of time on `size` pixels; the scale of y is that of what is seen.
  function overTime(chart, size, range) {
    const shown = chart.lines.map((line) => cut(chart.time, line.y, range));
    const rx = widened(range, 0);
    const ry = widened(rangeOf(...shown.map(([, y]) => y), [chart.level, chart.band, -chart.band]), 0.05);
    const at = frame(rx, ry, size, margins);
    const inside = (t) => t >= rx[0] && t <= rx[1];
    let out = "";
    for (const [from, to] of chart.spans || []) {
      const [left, right] = [Math.max(at.x(from), at.left), Math.min(at.x(to), at.right)];
      if (right >= left) out += box("span", left, at.top, Math.max(right - left, 0.5), at.bottom - at.top);
    }
    if (finite(chart.band)) out += box("noise", at.left, at.y(chart.band), at.right - at.left, at.y(-chart.band) - at.y(chart.band));
    out += grid(at, rx, ry, size, { after: " s" });
    if (finite(chart.level)) out += segment("level", at.left, at.y(chart.level), at.right, at.y(chart.level));
    for (const t of chart.flags || []) if (inside(t)) out += segment("flag", at.x(t), at.top, at.x(t), at.top + 7);
    chart.lines.forEach((line, k) => (out += `<path class="${line.css}" d="${path(...shown[k], at, 1)}"/>`));
    return svg("time", ...size, out);
  }

  // First and last time of all charts of a set.
  function setRange(d, page) {
    if (d.set === "ball") return ends(timeChart(d, page).time);
    return rangeOf(...page.series[d.set].map((s, joint) => ends(timeChart({ ...d, joint }, page).time)));
  }

  const timeSize = (d, wide = 900) => [wide, d.part === "value" ? 210 : 110];

  return { Axis, timeChart, overTime, setRange, timeSize };
})();
