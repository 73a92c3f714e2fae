"use strict";
// Drawings of a run as SVG text. A drawing takes `d`, what its place in the page says (data-*), and `page`: of
// result.json and series.json what the page holds. None touches the document.
const Draw = (() => {
  const still = {
    time: (d, page) => Time.overTime(Time.timeChart(d, page), Time.timeSize(d), Time.setRange(d, page)),
    player: (d, page) => Movement.player(d, page).svg,
    ...Curves,
    space: Ball.space,
    sphere: Ball.sphere,
    strip: Movement.strip,
    distance: Movement.distance,
  };
  return { still, pathInSpace: Ball.pathInSpace, ...Strokes, ...Time, ...Movement };
})();
