"use strict";
// Movements: arm, cup, string and ball in the plane in which they happen.
const Movement = (() => {
  const { px, text, box, disc, stroke, svg, rangeOf, width, widened, ends, axes } = Strokes;
  const { overTime } = Time;

  const taut = 0.97;  // of its length: a string that is shorter hangs through
  const apart = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]);
  const at = (f, name, k) => [f[name].across[k], f[name].up[k]];

  // The last row at which the ball comes in over the rim; −1: never.
  function entry(f, rows) {
    const inCup = (k) => {
      const [left, right, ball] = [at(f, "rim_left", k), at(f, "rim_right", k), at(f, "ball", k)], w = Math.max(apart(left, right), 1e-9);
      const s = [(right[0] - left[0]) / w, (right[1] - left[1]) / w], d = [ball[0] - (left[0] + right[0]) / 2, ball[1] - (left[1] + right[1]) / 2];
      return { above: s[0] * d[1] - s[1] * d[0], off: Math.abs(s[0] * d[0] + s[1] * d[1]), radius: w / 2 };
    };
    for (let k = rows - 1; k > 0; k--) {
      const before = inCup(k - 1), now = inCup(k);
      if (before.above > 0 && now.above <= 0 && now.off < now.radius) return k;
    }
    return -1;
  }

  // About `count` rows, in order: start, the far end of the swing, the string slack, the ball over the rim or nearest
  // to the cup, the end; and some between.
  function tellingTimes(f, string, count) {
    const rows = f.ball.across.length, come = entry(f, rows);
    const largest = (to, value) => Array.from({ length: to }, (_, k) => k).reduce((best, k) => (value(k) > value(best) ? k : best), 0);
    const near = come >= 0 ? come : largest(rows, (k) => -apart(at(f, "ball", k), at(f, "rim_left", k)) - apart(at(f, "ball", k), at(f, "rim_right", k)));
    let slack = 0;
    while (slack < near && apart(at(f, "knot", slack), at(f, "ball", slack)) >= taut * string) slack++;
    const swing = largest(slack + 1, (k) => Math.abs(f.ball.across[k] - f.ball.across[0]));
    const out = [], add = (row, what) => {
      if (!out.some((t) => t.row === row)) out.push({ row, what });
    };
    add(0, "start");
    add(rows - 1, "end");
    add(near, come >= 0 ? "over the rim" : "nearest to the cup");
    if (slack < near) add(slack, "string slack");
    if (swing > 0) add(swing, "swing");
    while (out.length < Math.min(count, rows)) {
      // The middle of the longest gap; what is before the catch counts twice.
      out.sort((a, b) => a.row - b.row);
      let best = -1, middle = 0;
      for (let i = 0; i + 1 < out.length; i++) {
        const gap = (out[i + 1].row - out[i].row) * (out[i].row < near ? 2 : 1);
        if (gap > best) [best, middle] = [gap, Math.floor((out[i].row + out[i + 1].row) / 2)];
      }
      const before = out.length;
      add(middle, "");
      if (out.length === before) break;
    }
    return out.sort((a, b) => a.row - b.row);
  }

  // A movement and its ghost, the ball as it was imagined; how much room they take [m].
  function scene(d, page) {
    const shown = page.series[d.movement][d.index], ghost = "ghost" in d ? page.series.imagined[d.index].figure : null;
    const all = [shown.figure, ghost].filter(Boolean).flatMap((f) => Object.values(f));
    const across = widened(rangeOf(...all.map((p) => p.across)), 0.04), up = widened(rangeOf(...all.map((p) => p.up)), 0.04);
    return { time: shown.time, figure: shown.figure, ghost, string: Number(d.string), across, up };
  }

  const placed = (s, left, bottom, scale) => (p) => [left + scale * (p[0] - s.across[0]), bottom - scale * (p[1] - s.up[0])];

  function trail(css, f, to, map) {
    return stroke(css, f.ball.across.slice(0, to + 1).map((x, k) => map([x, f.ball.up[k]])));
  }

  // A slack string hangs through by what it is too long (a parabola's, 8 s²/3d = L − d).
  function stringLine(knot, ball, length, map) {
    const d = apart(knot, ball), sag = d < taut * length ? Math.sqrt(0.375 * Math.max(d, 0.3 * length) * (length - d)) : 0;
    const [a, m, b] = [knot, [(knot[0] + ball[0]) / 2, (knot[1] + ball[1]) / 2 - 2 * sag], ball].map((p) => map(p).map(px).join(" "));
    return `<path class="string" d="M${a}Q${m} ${b}"/>`;
  }

  function moment(s, k, map, radius) {
    const f = s.figure, arm = Object.keys(f).filter((name) => name.startsWith("arm_"));
    let out = stroke("arm", arm.map((name) => map(at(f, name, k)))) + stroke("cup", ["rim_left", "floor_left", "floor_right", "rim_right"].map((name) => map(at(f, name, k))));
    if (s.string > 0) out += stringLine(at(f, "knot", k), at(f, "ball", k), s.string, map);
    if (s.ghost) out += disc("ghost", map(at(s.ghost, "ball", Math.min(k, s.ghost.ball.across.length - 1))), radius - 0.5);
    return out + disc("ball", map(at(f, "ball", k)), radius);
  }

  const seconds = (t) => t.toFixed(2) + " s";

  function strip(d, page) {
    const s = scene(d, page), columns = 4, [label, gap] = [18, 8], times = tellingTimes(s.figure, s.string, 8);
    const wide = 900 / columns - gap, scale = Math.min(wide / width(s.across), 300 / width(s.up)), high = scale * width(s.up);
    let out = "";
    times.forEach(({ row, what }, i) => {
      const left = (i % columns) * (wide + gap), top = Math.floor(i / columns) * (high + label + gap);
      const map = placed(s, left + (wide - scale * width(s.across)) / 2, top + label + high, scale);
      out += box("frame", left, top + label, wide, high) + (s.ghost ? trail("imagined", s.ghost, row, map) : "") + trail("obtained", s.figure, row, map);
      out += moment(s, row, map, 4) + text(left + 2, top + 13, "start", seconds(s.time[row]) + (what ? " · " + what : ""));
    });
    return svg("strip", 900, Math.ceil(times.length / columns) * (high + label + gap), out);
  }

  // The whole way and the last instant; `at(k)` draws another in its place.
  function player(d, page) {
    const s = scene(d, page), margin = 8, rows = s.time.length, scale = Math.min((900 - 2 * margin) / width(s.across), 440 / width(s.up)), high = scale * width(s.up);
    const map = placed(s, (900 - scale * width(s.across)) / 2, margin + high, scale), instant = (k) => moment(s, k, map, 6);
    const ways = (s.ghost ? trail("imagined", s.ghost, s.ghost.ball.across.length - 1, map) : "") + trail("obtained", s.figure, rows - 1, map);
    return { time: s.time, at: instant, svg: svg("strip", 900, high + 2 * margin, `${ways}<g>${instant(rows - 1)}</g>`) };
  }

  const toCup = ({ channels: c }) => c.ball_x.map((_, k) => Math.hypot(...axes.map((a) => c["ball_" + a][k] - c["cup_" + a][k])));

  // Distance of the ball from the cup's origin over time, imagined and obtained.
  function distance(d, page) {
    const obtained = page.series.obtained[d.index], imagined = page.series.imagined[d.index] || { time: [] }, model = imagined.time.length ? toCup(imagined) : [];
    let k = 0;
    const inModel = obtained.time.map((t) => {  // on the same axis; rows come at one rate
      while (k < imagined.time.length && imagined.time[k] < t - 1e-6) k++;
      return k < imagined.time.length ? model[k] : null;
    });
    const lines = [{ css: "imagined", y: inModel }, { css: "fitted", y: toCup(obtained) }];
    return overTime({ time: obtained.time, lines }, [900, 230], ends(obtained.time));
  }

  return { strip, player, seconds, distance };
})();
