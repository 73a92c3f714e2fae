"use strict";
// Replaces the drawings by charts that zoom, where the library is there. All charts of one set share their time axis.
(function () {
  if (typeof Dygraph === "undefined") return;
  const data = JSON.parse(document.getElementById("data").textContent);
  const ball = document.getElementById("ball");
  if (ball) data.ball = JSON.parse(ball.textContent).charts;
  const color = { measured: "#b4b8c4", after: "#0072b2", before: "#e69f00" };

  // Columns `drawn` of a series; as errors measured − model if both models' are drawn, else model − measured.
  function rows(series, drawn, residual, both) {
    if (residual && series.error) return series.time.map((t, k) => [t, ...drawn.map((name) => series.error[name][k])]);
    const column = { measured: series.measured, before: series.nominal, after: series.fitted };
    return series.time.map((t, k) => {
      const m = series.measured[k];
      return [t, ...drawn.map((name) => {
        const y = column[name][k];
        if (!residual || y === null || m === null) return residual ? null : y;
        return both ? m - y : y - m;
      })];
    });
  }

  // What stands behind the lines: stretches of time, a band about zero, a level, ticks.
  function backdrop(series, residual) {
    return (canvas, area, chart) => {
      const y = (value) => chart.toDomYCoord(value);
      if (!residual) {
        canvas.fillStyle = "#eaf3fa";
        for (const [from, to] of series.spans || []) canvas.fillRect(chart.toDomXCoord(from), area.y, chart.toDomXCoord(to) - chart.toDomXCoord(from), area.h);
      } else if (series.band) {
        canvas.fillStyle = "#e3e6ee";
        canvas.fillRect(area.x, y(series.band), area.w, y(-series.band) - y(series.band));
      }
      canvas.lineWidth = 1;
      if (!residual && series.level) {
        canvas.strokeStyle = color.after;
        canvas.setLineDash([5, 4]);
        canvas.strokeRect(area.x - 5, y(series.level), area.w + 10, 0);
        canvas.setLineDash([]);
      }
      canvas.fillStyle = "#b3261e";
      for (const t of series.flags || []) canvas.fillRect(chart.toDomXCoord(t), area.y, 1.5, 7);
    };
  }

  function draw(holder, series, group) {
    const residual = holder.classList.contains("residual");
    const both = (!residual || group.both) && !group.one;
    const drawn = [...(residual ? [] : ["measured"]), ...(both ? ["before"] : []), "after"];
    const labels = ["time", ...drawn.map((name) => group.names[name])];
    const plot = document.createElement("div");
    plot.className = "plot";
    holder.appendChild(plot);
    holder.classList.add("live");
    const chart = new Dygraph(plot, rows(series, drawn, residual, group.both), {
      labels: labels,
      colors: drawn.map((name) => color[name]),
      strokeWidth: 1.2,
      series: residual ? {} : { measured: { strokeWidth: 3 } },
      dateWindow: group.range,
      underlayCallback: series.error ? backdrop(series, residual) : null,
      legend: "onmouseover",
      digitsAfterDecimal: 3,
      axes: { y: { pixelsPerLabel: residual ? 20 : 30, axisLabelFormatter: (y) => String(+y.toPrecision(4)) }, x: { axisLabelFormatter: (t) => String(+t.toPrecision(6)), valueFormatter: (t) => t.toFixed(3) + " s" } },
      axisLabelWidth: 46,
      ylabel: "",
      drawCallback: (self, initial) => {
        if (initial || group.busy) return;
        group.busy = true;
        const range = self.isZoomed("x") ? self.xAxisRange() : group.range;
        for (const other of group.charts) {
          if (other !== self) other.updateOptions({ dateWindow: range });
        }
        group.busy = false;
      },
    });
    group.charts.push(chart);
  }

  document.body.classList.add("zooms");
  for (const section of document.querySelectorAll("[data-set]")) {
    const names = { measured: "measured", before: section.dataset.before, after: section.dataset.after };
    const group = { charts: [], busy: true, names: names, both: "both" in section.dataset, one: "one" in section.dataset };
    const start = () => {
      if (group.charts.length) return;
      const used = data[section.dataset.set].filter((series) => series.time.length);
      group.range = [Math.min(...used.map((s) => s.time[0])), Math.max(...used.map((s) => s.time[s.time.length - 1]))];
      for (const holder of section.querySelectorAll(".chart")) {
        const series = data[section.dataset.set][Number(holder.dataset.joint)];
        if (series && series.time.length) draw(holder, series, group);
      }
      group.busy = false;
    };
    if (section.tagName === "DETAILS" && !section.open) section.addEventListener("toggle", start);
    else start();
  }
})();

// The ball's path in space, one scale along all axes, turned by dragging.
(function () {
  const data = document.getElementById("ball"), holder = document.querySelector(".turns");
  if (!data || !holder) return;
  const space = JSON.parse(data.textContent).space;
  const styles = { anchor: ["#445", 1.2], measured: ["#b4b8c4", 3], nominal: ["#e69f00", 1.2], fitted: ["#0072b2", 1.2] };
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  for (const name of ["anchor", "measured", "fitted"]) {
    for (const p of (space[name] || []).flat()) {
      if (p) p.forEach((x, c) => { low[c] = Math.min(low[c], x); high[c] = Math.max(high[c], x); });
    }
  }
  if (!(low[0] <= high[0])) return;
  const middle = low.map((x, c) => (x + high[c]) / 2);
  const radius = Math.max(Math.hypot(...low.map((x, c) => high[c] - x)) / 2, 1e-3);
  const canvas = holder.appendChild(document.createElement("canvas"));
  const start = { azimuth: 0.7, elevation: 0.35 };
  let { azimuth, elevation } = start;

  function paint() {
    const width = holder.clientWidth, height = holder.clientHeight, ratio = window.devicePixelRatio || 1;
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    const pen = canvas.getContext("2d"), scale = 0.92 * Math.min(width, height) / 2 / radius;
    pen.scale(ratio, ratio);
    pen.lineJoin = "round";
    const [sa, ca, se, ce] = [Math.sin(azimuth), Math.cos(azimuth), Math.sin(elevation), Math.cos(elevation)];
    // Seen from (cos azimuth, sin azimuth) and above by the elevation.
    const at = (p) => {
      const [x, y, z] = p.map((v, c) => v - middle[c]);
      return [width / 2 + scale * (ca * y - sa * x), height / 2 - scale * (ce * z - se * (ca * x + sa * y))];
    };
    const stroke = (points, color, thick) => {
      pen.beginPath();
      let drawing = false;
      for (const p of points) {
        if (p) drawing ? pen.lineTo(...at(p)) : pen.moveTo(...at(p));
        drawing = Boolean(p);
      }
      pen.strokeStyle = color;
      pen.lineWidth = thick;
      pen.stroke();
    };
    // The floor of the box and the z axis.
    const corner = (i, j, k) => [i ? high[0] : low[0], j ? high[1] : low[1], k ? high[2] : low[2]];
    stroke([corner(0, 0, 0), corner(1, 0, 0), corner(1, 1, 0), corner(0, 1, 0), corner(0, 0, 0), corner(0, 0, 1)], "#ccd", 1);
    // The string now and then.
    if (space.anchor) {
      space.anchor.forEach((path, w) => {
        const step = Math.max(1, Math.floor(path.length / 14));
        for (let k = 0; k < path.length; k += step) {
          if (path[k] && space.measured[w][k]) stroke([path[k], space.measured[w][k]], "#dde", 1);
        }
      });
    }
    for (const name of ["measured", "nominal", "fitted", "anchor"]) {
      for (const path of space[name] || []) stroke(path, ...styles[name]);
    }
    pen.fillStyle = "#223";
    pen.font = "11px system-ui, sans-serif";
    pen.textAlign = "center";
    [[1, 0, 0], [0, 1, 0], [0, 0, 1]].forEach((end, c) => {
      const [x, y] = at(corner(...end)), [x0, y0] = at(corner(0, 0, 0)), far = Math.hypot(x - x0, y - y0);
      if (far > 20) pen.fillText("xyz"[c] + " " + high[c].toFixed(2), x + 16 * (x - x0) / far, y + 4 + 12 * (y - y0) / far);
    });
    pen.fillText(low.map((v) => v.toFixed(2)).join(", ") + " m", at(corner(0, 0, 0))[0], at(corner(0, 0, 0))[1] + 14);
  }

  canvas.addEventListener("pointerdown", (down) => {
    canvas.setPointerCapture(down.pointerId);
    let [x, y] = [down.clientX, down.clientY];
    canvas.onpointermove = (move) => {
      azimuth -= (move.clientX - x) * 0.01;
      elevation = Math.max(-1.57, Math.min(1.57, elevation + (move.clientY - y) * 0.01));
      [x, y] = [move.clientX, move.clientY];
      paint();
    };
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { canvas.onpointermove = null; });
  canvas.addEventListener("dblclick", () => { ({ azimuth, elevation } = start); paint(); });
  window.addEventListener("resize", paint);
  document.body.classList.add("turns-space");
  paint();
})();

// Movements that play: arm, cup, string and ball at one instant, on the paths that the page has drawn.
(function () {
  for (const holder of document.querySelectorAll(".player")) {
    const m = JSON.parse(holder.querySelector("script").textContent), group = holder.querySelector("g");
    const x = (v) => (m.left + m.scale * (v - m.low[0])).toFixed(1), y = (v) => (m.bottom - m.scale * (v - m.low[1])).toFixed(1);
    const rows = m.time.length, n = m.points.length;
    const at = (i, k) => [m.points[i][0][k], m.points[i][1][k]];
    const xy = (p) => x(p[0]) + " " + y(p[1]);
    const stroke = (name, points) => `<path class="${name}" d="M${points.map(xy).join("L")}"/>`;
    const disc = (name, p, r) => `<circle class="${name}" cx="${x(p[0])}" cy="${y(p[1])}" r="${r}"/>`;
    const range = (from, to) => Array.from({ length: to - from }, (_, i) => from + i);

    function draw(k) {
      const knot = at(n - 6, k), ball = at(n - 1, k), d = Math.hypot(knot[0] - ball[0], knot[1] - ball[1]);
      const sag = d < m.taut * m.string ? Math.sqrt(0.375 * Math.max(d, 0.3 * m.string) * (m.string - d)) : 0;
      const middle = [(knot[0] + ball[0]) / 2, (knot[1] + ball[1]) / 2 - 2 * sag];
      const g = m.ghost && Math.min(k, m.ghost[0].length - 1);
      group.innerHTML = stroke("arm", range(0, m.arm).map((i) => at(i, k))) + stroke("cup", range(n - 5, n - 1).map((i) => at(i, k))) +
        `<path class="string" d="M${xy(knot)}Q${xy(middle)} ${xy(ball)}"/>` + (m.ghost ? disc("ghost", [m.ghost[0][g], m.ghost[1][g]], 5) : "") + disc("ball", ball, 6);
      slider.value = k;
      shown.textContent = m.time[k].toFixed(2) + " s";
    }

    const controls = document.createElement("div");
    controls.className = "controls";
    controls.innerHTML = `<button type="button">Play</button><input type="range" min="0" max="${rows - 1}" step="1" aria-label="time"><output></output>`;
    const [button, slider, shown] = controls.children;
    holder.append(controls);
    holder.classList.add("plays");
    let started = null, from = 0;
    const stop = () => { started = null; button.textContent = "Play"; };
    function step(now) {
      if (started === null) return;
      if (started === 0) started = now;
      const t = m.time[from] + (now - started) / 1000;
      let k = from;
      while (k < rows - 1 && m.time[k + 1] <= t) k++;
      draw(k);
      k === rows - 1 ? stop() : requestAnimationFrame(step);
    }
    button.addEventListener("click", () => {
      if (started !== null) return stop();
      from = Number(slider.value) === rows - 1 ? 0 : Number(slider.value);
      started = 0;
      button.textContent = "Pause";
      requestAnimationFrame(step);
    });
    slider.addEventListener("input", () => { stop(); draw(Number(slider.value)); });
    draw(rows - 1);
  }
})();
