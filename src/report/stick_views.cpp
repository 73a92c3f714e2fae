#include "report/stick_views.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/c_numbers.hpp"
#include "report/html.hpp"

namespace diffnea::report {
namespace {

constexpr double kWidth = 900.0;
constexpr double kTaut = 0.97;  ///< of its length: a string that is shorter hangs through

struct Point {
  double x, y;
};
double distance(const Point& a, const Point& b) { return std::hypot(a.x - b.x, a.y - b.y); }

/// The figure's last six points, see StickFigure.
enum Named { kKnot = 6, kRimLeft = 5, kFloorLeft = 4, kFloorRight = 3, kRimRight = 2, kBall = 1 };

Point at(const StickFigure& f, long row, Named name) {
  const long column = f.across.cols() - static_cast<long>(name);
  return {f.across(row, column), f.up(row, column)};
}

/// The ball in the cup's frame as the plane shows it: above its rim, and off its middle.
struct InCup {
  double above, off, radius;
};
InCup in_cup(const StickFigure& f, long row) {
  const Point left = at(f, row, kRimLeft), right = at(f, row, kRimRight), ball = at(f, row, kBall);
  const double width = std::max(distance(left, right), 1e-9);
  const Point s{(right.x - left.x) / width, (right.y - left.y) / width},
      d{ball.x - 0.5 * (left.x + right.x), ball.y - 0.5 * (left.y + right.y)};
  return {-s.y * d.x + s.x * d.y, std::abs(s.x * d.x + s.y * d.y), 0.5 * width};
}

long rows_of(const StickFigure& f) { return f.time.size(); }

/// The last row at which the ball comes in over the rim; −1: never.
long entry(const StickFigure& f) {
  for (long k = rows_of(f) - 1; k > 0; --k) {
    const InCup before = in_cup(f, k - 1), now = in_cup(f, k);
    if (before.above > 0.0 && now.above <= 0.0 && now.off < now.radius) return k;
  }
  return -1;
}

template <typename Value>
long largest(long from, long to, const Value& value) {
  long best = from;
  for (long k = from; k < to; ++k)
    if (value(k) > value(best)) best = k;
  return best;
}

/// From metres to a frame's pixels.
struct Map {
  double left, bottom, scale;
  Range across, up;
  Point operator()(const Point& p) const {
    return {left + scale * (p.x - across.low), bottom - scale * (p.y - up.low)};
  }
};

std::string xy(const Point& p) { return coordinate(p.x) + " " + coordinate(p.y); }

std::string stroke(const char* css_class, const std::vector<Point>& points) {
  std::string d;
  for (const Point& p : points) d += (d.empty() ? "M" : "L") + xy(p);
  return std::string("<path class='") + css_class + "' d='" + d + "'/>";
}

std::string trail(const char* css_class, const StickFigure& f, long to, const Map& map) {
  std::vector<Point> points;
  for (long k = 0; k <= std::min(to, rows_of(f) - 1); ++k) points.push_back(map(at(f, k, kBall)));
  return stroke(css_class, points);
}

std::string disc(const char* css_class, const Point& p, double radius) {
  return std::string("<circle class='") + css_class + "' cx='" + coordinate(p.x) + "' cy='" +
         coordinate(p.y) + "' r='" + coordinate(radius) + "'/>";
}

/// A slack string hangs through by what it is too long (a parabola's, 8 s²/3d = L − d).
std::string string_line(const Point& knot, const Point& ball, double length, const Map& map) {
  const double d = distance(knot, ball);
  const double slack = std::max(length - d, 0.0);
  const double sag = d < kTaut * length ? std::sqrt(0.375 * std::max(d, 0.3 * length) * slack) : 0;
  const Point a = map(knot), b = map(ball),
              middle = map({0.5 * (knot.x + ball.x), 0.5 * (knot.y + ball.y) - 2.0 * sag});
  return "<path class='string' d='M" + xy(a) + "Q" + xy(middle) + " " + xy(b) + "'/>";
}

std::string drawing(const StickFigure& f, long row, const StickFigure* ghost, double string,
                    const Map& map) {
  std::vector<Point> arm, cup;
  for (int i = 0; i < f.arm_points(); ++i) arm.push_back(map({f.across(row, i), f.up(row, i)}));
  for (const Named name : {kRimLeft, kFloorLeft, kFloorRight, kRimRight})
    cup.push_back(map(at(f, row, name)));
  std::string out = stroke("arm", arm) + stroke("cup", cup);
  if (string > 0.0) out += string_line(at(f, row, kKnot), at(f, row, kBall), string, map);
  if (ghost && rows_of(*ghost) > 0)
    out += disc("ghost", map(at(*ghost, std::min(row, rows_of(*ghost) - 1), kBall)), 3.5);
  return out + disc("ball", map(at(f, row, kBall)), 4.0);
}

std::string seconds(double t) {
  char text[32];
  detail::print(text, sizeof text, "%.2f s", t);
  return text;
}

/// A column of numbers as JSON, to 0.1 mm.
std::string numbers(const VecX<double>& x) {
  std::string out;
  char text[32];
  for (const double v : x) {
    detail::print(text, sizeof text, "%.4f", v);
    out += (out.empty() ? "[" : ",") + std::string(text);
  }
  return out.empty() ? "[]" : out + "]";
}

}  // namespace

std::vector<TellingTime> telling_times(const StickFigure& f, double string, int count) {
  const long rows = rows_of(f);
  if (rows == 0) return {};
  const long end = rows - 1, in = entry(f);
  const long near = in >= 0 ? in : largest(0, rows, [&](long k) {
    return -distance(at(f, k, kBall), at(f, k, kRimLeft)) -
           distance(at(f, k, kBall), at(f, k, kRimRight));
  });
  long slack = 0;
  while (slack < near && distance(at(f, slack, kKnot), at(f, slack, kBall)) >= kTaut * string)
    ++slack;
  const long swing = largest(
      0, slack + 1, [&](long k) { return std::abs(at(f, k, kBall).x - at(f, 0, kBall).x); });
  std::vector<TellingTime> out;
  const auto add = [&](long row, const char* what) {
    if (std::ranges::find(out, row, &TellingTime::row) == out.end()) out.push_back({row, what});
  };
  add(0, "start");
  add(end, "end");
  add(near, in >= 0 ? "over the rim" : "nearest to the cup");
  if (slack < near) add(slack, "string slack");
  if (swing > 0) add(swing, "swing");
  while (static_cast<int>(out.size()) < std::min<long>(count, rows)) {
    // The middle of the longest gap; what is before the catch counts twice.
    std::ranges::sort(out, {}, &TellingTime::row);
    long best = -1, middle = 0;
    for (std::size_t i = 0; i + 1 < out.size(); ++i) {
      const long gap = (out[i + 1].row - out[i].row) * (out[i].row < near ? 2 : 1);
      if (gap <= best) continue;
      best = gap;
      middle = (out[i].row + out[i + 1].row) / 2;
    }
    const std::size_t before = out.size();
    add(middle, "");
    if (out.size() == before) break;
  }
  std::ranges::sort(out, {}, &TellingTime::row);
  return out;
}

Stage stage(const std::vector<const StickFigure*>& figures) {
  Stage out;
  for (const StickFigure* f : figures) {
    if (!f) continue;
    for (const double x : f->across.reshaped()) out.across.take(x);
    for (const double y : f->up.reshaped()) out.up.take(y);
  }
  out.across = out.across.widened(0.04);
  out.up = out.up.widened(0.04);
  return out;
}

std::string film_strip(const StickFigure& f, const StickFigure* ghost, double string) {
  constexpr int kFrames = 8, kColumns = 4;
  constexpr double kLabel = 18.0, kGap = 8.0, kMostHeight = 300.0;
  const std::vector<TellingTime> times = telling_times(f, string, kFrames);
  if (times.empty()) return "";
  const Stage seen = stage({&f, ghost});
  const double wide = kWidth / kColumns - kGap;
  const double scale = std::min(wide / seen.across.width(), kMostHeight / seen.up.width());
  const double high = scale * seen.up.width();
  const double lines = std::ceil(static_cast<double>(times.size()) / kColumns);
  std::string out = "<svg class='strip' viewBox='0 0 " + coordinate(kWidth) + " " +
                    coordinate(lines * (high + kLabel + kGap)) + "' role='img'>";
  for (std::size_t i = 0; i < times.size(); ++i) {
    const double left = static_cast<double>(i % kColumns) * (wide + kGap);
    const double top = static_cast<double>(i / kColumns) * (high + kLabel + kGap);
    const double inner = left + 0.5 * (wide - scale * seen.across.width());
    const Map map{inner, top + kLabel + high, scale, seen.across, seen.up};
    out += box("frame", left, top + kLabel, wide, high);
    if (ghost) out += trail("imagined", *ghost, times[i].row, map);
    out += trail("obtained", f, times[i].row, map) + drawing(f, times[i].row, ghost, string, map) +
           text_at(left + 2, top + 13, "start",
                   seconds(f.time[times[i].row]) +
                       (times[i].what.empty() ? "" : " · " + times[i].what));
  }
  return out + "</svg>\n";
}

std::string player(const StickFigure& f, const StickFigure* ghost, double string) {
  constexpr double kMostHeight = 440.0, kMargin = 8.0;
  const long rows = rows_of(f);
  if (rows == 0) return "";
  const Stage seen = stage({&f, ghost});
  const double scale =
      std::min((kWidth - 2 * kMargin) / seen.across.width(), kMostHeight / seen.up.width());
  const double high = scale * seen.up.width();
  const Map map{0.5 * (kWidth - scale * seen.across.width()), kMargin + high, scale, seen.across,
                seen.up};
  std::string out = "<div class='player'><svg class='strip' viewBox='0 0 " + coordinate(kWidth) +
                    " " + coordinate(high + 2 * kMargin) + "' role='img'>";
  if (ghost) out += trail("imagined", *ghost, rows_of(*ghost), map);
  out += trail("obtained", f, rows, map) + "<g>" + drawing(f, rows - 1, ghost, string, map) +
         "</g></svg>";
  char place[160];
  detail::print(place, sizeof place, "\"left\":%.6g,\"bottom\":%.6g,\"scale\":%.6g", map.left,
                map.bottom, map.scale);
  out += "<script type='application/json'>{" + std::string(place);
  detail::print(place, sizeof place, ",\"low\":[%.6g,%.6g],\"string\":%.6g,\"taut\":%.6g",
                seen.across.low, seen.up.low, string, kTaut);
  out += std::string(place) + ",\"arm\":" + std::to_string(f.arm_points()) +
         ",\"time\":" + numbers(f.time) + ",\"points\":[";
  for (long i = 0; i < f.across.cols(); ++i)
    out += (i ? ",[" : "[") + numbers(f.across.col(i)) + "," + numbers(f.up.col(i)) + "]";
  out += "],\"ghost\":";
  if (ghost && rows_of(*ghost) > 0)
    out += "[" + numbers(ghost->across.col(ghost->across.cols() - kBall)) + "," +
           numbers(ghost->up.col(ghost->up.cols() - kBall)) + "]";
  else
    out += "null";
  return out + "}</script></div>\n";
}

}  // namespace diffnea::report
