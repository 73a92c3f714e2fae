"use strict";
// Replaces the drawings by charts that zoom, where the library is there. All charts of one set share their time axis.
(function () {
  if (typeof Dygraph === "undefined") return;
  const data = JSON.parse(document.getElementById("data").textContent);
  const color = { measured: "#b4b8c4", after: "#0072b2", before: "#e69f00" };

  // Columns `drawn` of a series; as errors measured − model if both models' are drawn, else model − measured.
  function rows(series, drawn, residual, both) {
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
      legend: "onmouseover",
      digitsAfterDecimal: 3,
      axes: { y: { pixelsPerLabel: residual ? 20 : 30 }, x: { axisLabelFormatter: (t) => String(+t.toPrecision(6)), valueFormatter: (t) => t.toFixed(3) + " s" } },
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
