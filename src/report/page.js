"use strict";
// Fills the places of the page (data-draw) with their drawings. Charts over time zoom, those of one set together; the
// path in space turns; movements play.
(() => {
  const page = JSON.parse(document.getElementById("data").textContent);
  const places = (kind) => [...document.querySelectorAll(kind ? `[data-draw="${kind}"]` : "[data-draw]")];

  // A drawing that fails leaves its place empty, and the others alone.
  function attempt(action) {
    try {
      action();
    } catch (error) {
      reportError(error);
    }
  }

  // A table of bars holds their numbers, and is shown where no script runs.
  function rowsOf(place) {
    return [...place.querySelectorAll("tr")].map((row) => ({ css: row.className, label: row.cells[0].textContent, text: row.cells[1].textContent, from: Number(row.dataset.from || NaN), to: Number(row.dataset.to || NaN) }));
  }

  for (const place of places()) {
    const kind = place.dataset.draw;
    if (kind in Draw.still && kind !== "time") attempt(() => (place.innerHTML = Draw.still[kind]({ ...place.dataset, rows: rowsOf(place) }, page)));
  }

  // --- charts over time

  class TimeChart {
    constructor(place, set) {
      this.place = place;
      this.set = set;
      this.chart = Draw.timeChart(place.dataset, page);
      this.drawing = place.appendChild(document.createElement("div"));
      this.readout = place.appendChild(document.createElement("output"));
      place.classList.add("live");
      new ResizeObserver(() => this.wide !== place.clientWidth && place.clientWidth && this.draw()).observe(place);
      place.addEventListener("pointerdown", (event) => this.start(event));
      place.addEventListener("pointermove", (event) => this.move(event));
      place.addEventListener("pointerup", (event) => this.end(event));
      place.addEventListener("pointerleave", () => this.point(null));
      place.addEventListener("dblclick", () => set.show(set.all));
      this.draw();
    }
    draw() {
      this.wide = this.place.clientWidth || 900;
      this.drawing.innerHTML = Draw.overTime(this.chart, Draw.timeSize(this.place.dataset, this.wide), this.set.range);
      this.point(null);
    }
    // The time below the pointer.
    time(event) {
      const [left, right] = Draw.margins, inner = this.wide - left - right, [low, high] = this.set.range;
      const share = (event.clientX - this.place.getBoundingClientRect().left - left) / inner;
      return low + Math.min(Math.max(share, 0), 1) * (high - low);
    }
    x(t) {
      const [left, right] = Draw.margins, [low, high] = this.set.range;
      return left + ((t - low) / (high - low)) * (this.wide - left - right);
    }
    start(event) {
      if (event.button !== 0) return;
      this.from = this.time(event);
      this.place.setPointerCapture(event.pointerId);
    }
    move(event) {
      this.point(this.time(event));
    }
    end(event) {
      const range = [this.from, this.time(event)].sort((a, b) => a - b);
      const isDrag = this.from !== undefined && Math.abs(this.x(range[1]) - this.x(range[0])) > 4;
      this.from = undefined;
      if (isDrag) this.set.show(range);
    }
    // Values at a time, and the range that is being chosen; nothing without a time.
    point(t) {
      this.readout.textContent = "";
      for (const mark of this.drawing.querySelectorAll(".pointed")) mark.remove();
      if (t === null) return;
      const time = this.chart.time, height = Draw.timeSize(this.place.dataset)[1] - Draw.margins[3];
      let k = 0;
      for (let low = 0, high = time.length - 1; low < high; k = low) {
        const middle = (low + high) >> 1;
        if (time[middle] < t) low = middle + 1;
        else high = middle;
      }
      if (k > 0 && t - time[k - 1] < time[k] - t) k--;
      const values = this.chart.lines.filter((line) => Number.isFinite(line.y[k])).map((line) => `<b class="${line.css}">${Draw.escaped(line.name)}</b> ${Draw.number(line.y[k])}${this.chart.unit && " " + this.chart.unit}`);
      this.readout.innerHTML = [time[k].toFixed(3) + " s", ...values].join(" &nbsp; ");
      const from = this.x(this.from === undefined ? time[k] : this.from), to = this.x(this.from === undefined ? time[k] : t);
      this.drawing.firstChild.insertAdjacentHTML("beforeend", `<rect class="pointed" x="${Math.min(from, to)}" y="${Draw.margins[2]}" width="${Math.abs(to - from) || 1}" height="${height - Draw.margins[2]}"/>`);
    }
  }

  const sets = new Map();
  function addChart(place) {
    const name = place.dataset.set;
    if (!sets.has(name)) {
      const all = Draw.setRange(place.dataset, page), set = { all, range: all, charts: [] };
      set.show = (range) => {
        set.range = range;
        for (const chart of set.charts) chart.draw();
      };
      sets.set(name, set);
    }
    sets.get(name).charts.push(new TimeChart(place, sets.get(name)));
  }
  for (const place of places("time")) attempt(() => addChart(place));
  document.body.classList.add("zooms");

  // --- the ball's path in space, one scale along all axes, turned by dragging

  function turn(holder) {
    const space = Draw.pathInSpace(holder.dataset, page);
    const styles = { anchor: ["#445", 1.2], measured: ["#b4b8c4", 3], nominal: ["#e69f00", 1.2], fitted: ["#0072b2", 1.2] };
    const ranges = [0, 1, 2].map((c) => Draw.rangeOf(...["anchor", "measured", "fitted"].map((name) => (space[name] || []).flat().map((p) => (p ? p[c] : NaN)))));
    if (!(ranges[0][0] <= ranges[0][1])) return;
    const [low, high] = [ranges.map((r) => r[0]), ranges.map((r) => r[1])];
    const middle = low.map((x, c) => (x + high[c]) / 2);
    const radius = Math.max(Math.hypot(...low.map((x, c) => high[c] - x)) / 2, 1e-3);
    const canvas = holder.appendChild(document.createElement("canvas"));
    const start = { azimuth: 0.7, elevation: 0.35 };
    let { azimuth, elevation } = start;

    const paint = () => {
      const width = holder.clientWidth, height = holder.clientHeight, ratio = window.devicePixelRatio || 1;
      canvas.width = width * ratio;
      canvas.height = height * ratio;
      const pen = canvas.getContext("2d"), scale = (0.92 * Math.min(width, height)) / 2 / radius;
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
        points.forEach((p, k) => p && (k && points[k - 1] ? pen.lineTo(...at(p)) : pen.moveTo(...at(p))));
        pen.strokeStyle = color;
        pen.lineWidth = thick;
        pen.stroke();
      };
      // The floor of the box and the z axis.
      const corner = (i, j, k) => [i ? high[0] : low[0], j ? high[1] : low[1], k ? high[2] : low[2]];
      stroke([corner(0, 0, 0), corner(1, 0, 0), corner(1, 1, 0), corner(0, 1, 0), corner(0, 0, 0), corner(0, 0, 1)], "#ccd", 1);
      // The string now and then.
      (space.anchor || []).forEach((path, w) => {
        const step = Math.max(1, Math.floor(path.length / 14));
        for (let k = 0; k < path.length; k += step) if (path[k] && space.measured[w][k]) stroke([path[k], space.measured[w][k]], "#dde", 1);
      });
      for (const name of ["measured", "nominal", "fitted", "anchor"]) for (const path of space[name] || []) stroke(path, ...styles[name]);
      pen.fillStyle = "#223";
      pen.font = "11px system-ui, sans-serif";
      pen.textAlign = "center";
      [[1, 0, 0], [0, 1, 0], [0, 0, 1]].forEach((end, c) => {
        const [x, y] = at(corner(...end)), [x0, y0] = at(corner(0, 0, 0)), far = Math.hypot(x - x0, y - y0);
        if (far > 20) pen.fillText("xyz"[c] + " " + high[c].toFixed(2), x + (16 * (x - x0)) / far, y + 4 + (12 * (y - y0)) / far);
      });
      pen.fillText(low.map((v) => v.toFixed(2)).join(", ") + " m", at(corner(0, 0, 0))[0], at(corner(0, 0, 0))[1] + 14);
    };

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
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => (canvas.onpointermove = null));
    canvas.addEventListener("dblclick", () => {
      ({ azimuth, elevation } = start);
      paint();
    });
    window.addEventListener("resize", paint);
    document.body.classList.add("turns-space");
    paint();
  }
  for (const holder of places("turns")) attempt(() => turn(holder));

  // --- movements

  function play(holder) {
    const movement = Draw.player(holder.dataset, page), rows = movement.time.length, group = holder.querySelector("g");
    const controls = document.createElement("div");
    controls.className = "controls";
    controls.innerHTML = `<button type="button">Play</button><input type="range" min="0" max="${rows - 1}" step="1" aria-label="time"><output></output>`;
    const [button, slider, shown] = controls.children;
    const draw = (k) => {
      group.innerHTML = movement.at(k);
      slider.value = k;
      shown.textContent = Draw.seconds(movement.time[k]);
    };
    let started = null, from = 0;
    const stop = () => {
      started = null;
      button.textContent = "Play";
    };
    const step = (now) => {
      if (started === null) return;
      if (started === 0) started = now;
      const t = movement.time[from] + (now - started) / 1000;
      let k = from;
      while (k < rows - 1 && movement.time[k + 1] <= t) k++;
      draw(k);
      if (k === rows - 1) stop();
      else requestAnimationFrame(step);
    };
    button.addEventListener("click", () => {
      if (started !== null) return stop();
      from = Number(slider.value) === rows - 1 ? 0 : Number(slider.value);
      started = 0;
      button.textContent = "Pause";
      requestAnimationFrame(step);
    });
    slider.addEventListener("input", () => {
      stop();
      draw(Number(slider.value));
    });
    holder.append(controls);
    draw(rows - 1);
  }
  for (const holder of places("player")) attempt(() => play(holder));
})();
