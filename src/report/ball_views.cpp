#include "report/ball_views.hpp"

#include <array>

#include "core/c_numbers.hpp"
#include "report/format.hpp"
#include "report/html.hpp"
#include "report/svg.hpp"

namespace diffnea::report {
namespace {

using Point = BallSeries::Point;

constexpr std::size_t kMostPathRows = 1600;   ///< points of each line in space
constexpr std::size_t kMostPathWindows = 4;   ///< more are a tangle
constexpr std::size_t kMostWindowRows = 800;  ///< points of one window
constexpr double kWidth = 900.0;
constexpr double kMostHeight = 340.0;  ///< of the highest view in space

bool finite(const Point& p) {
  return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
}
double dot(const Point& a, const Point& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Point minus(const Point& a, const Point& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

/// How many ticks have room, `spacing` pixels apart. A range that no number holds has no length.
int ticks_over(double length, double spacing) {
  return length > 3.0 * spacing && length < 2.0 * kWidth ? static_cast<int>(length / spacing) : 3;
}

/// What is drawn in space, the wide grey line first.
struct SpaceLine {
  const char* css_class;
  const std::vector<Point>* points;
};
std::vector<SpaceLine> space_lines(const BallSeries& b, bool with_base) {
  std::vector<SpaceLine> out{{"measured", &b.measured}};
  if (b.has_string) out.insert(out.begin(), {"anchor", &b.anchor});
  if (with_base) out.push_back({"nominal", &b.base});
  out.push_back({"fitted", &b.extended});
  return out;
}

/// What all rows that are shown take up along each axis, none of them thin. A base model that flies
/// off does not count; its line ends at the frame.
std::array<Range, 3> extent(const BallSeries& b, const ShownPath& shown) {
  std::array<Range, 3> out;
  for (const std::vector<std::size_t>& rows : shown.rows)
    for (const std::size_t k : rows)
      for (const Point* p : {&b.measured[k], &b.extended[k], &b.anchor[k]})
        if (finite(*p) && (p != &b.anchor[k] || b.has_string))
          for (std::size_t c = 0; c < 3; ++c) out[c].take((*p)[c]);
  double widest = 1e-3;
  for (const Range& r : out)
    if (!r.empty()) widest = std::max(widest, r.width());
  const std::array<Range, 3> seen = out;
  for (const std::vector<std::size_t>& rows : shown.rows)
    for (const std::size_t k : rows)
      for (std::size_t c = 0; c < 3; ++c)
        if (const double x = b.base[k][c];
            x > seen[c].low - 0.25 * widest && x < seen[c].high + 0.25 * widest)
          out[c].take(x);
  for (Range& r : out) {
    if (r.empty()) r = {0.0, 0.0};
    const double margin = std::max(0.04 * widest, 0.5 * (0.25 * widest - r.width()));
    r = {r.low - margin, r.high + margin};
  }
  return out;
}

}  // namespace

std::vector<std::pair<std::size_t, std::size_t>> windows_of(const BallSeries& b) {
  std::vector<std::pair<std::size_t, std::size_t>> out;
  for (std::size_t k = 0; k < b.time.size(); ++k)
    if (k == 0 || b.window[k] != b.window[k - 1] || b.run[k] != b.run[k - 1])
      out.emplace_back(k, k + 1);
    else
      out.back().second = k + 1;
  return out;
}

ShownPath shown_path(const BallSeries& b) {
  const auto windows = windows_of(b);
  ShownPath out;
  out.windows = windows.size();
  const std::size_t most = std::min(kMostPathWindows, windows.size());
  std::size_t left = kMostPathRows;
  for (std::size_t i = 0; i < most; ++i) {
    const auto [from, to] = windows[(2 * i + 1) * windows.size() / (2 * most)];
    const std::size_t may = std::min(kMostWindowRows, left / (most - i));
    const std::size_t stride = std::max<std::size_t>(1, (to - from + may - 1) / may);
    std::vector<std::size_t> rows;
    for (std::size_t k = from; k < to; k += stride) rows.push_back(k);
    left -= std::min(left, rows.size());
    out.rows.push_back(std::move(rows));
  }
  return out;
}

std::string projections(const BallSeries& b, const ShownPath& shown, bool with_base) {
  constexpr double kLeft = 46.0, kTop = 22.0, kBottom = 34.0, kGap = 8.0;
  struct View {
    const char* title;
    std::size_t across, up;
  };
  constexpr std::array<View, 3> kViews{{{"from the front (x, z)", 0, 2},
                                        {"from the side (y, z)", 1, 2},
                                        {"from above (x, y)", 0, 1}}};
  const std::array<Range, 3> range = extent(b, shown);
  double wide = 0.0, high = 0.0;
  for (const View& v : kViews) {
    wide += range[v.across].width();
    high = std::max(high, range[v.up].width());
  }
  const double scale = std::min((kWidth - 3.0 * (kLeft + kGap)) / wide, kMostHeight / high);
  const double height = kTop + scale * high + kBottom;
  std::string out = "<svg class='space' viewBox='0 0 " + coordinate(kWidth) + " " +
                    coordinate(height) + "' role='img'>";
  double left = 0.0;
  for (const View& v : kViews) {
    const Range &rx = range[v.across], &ry = range[v.up];
    left += kLeft;
    const double bottom = kTop + scale * ry.width();
    const auto to_x = [&](double x) { return left + scale * (x - rx.low); };
    const auto to_y = [&](double y) { return bottom - scale * (y - ry.low); };
    const double w = scale * rx.width(), h = scale * ry.width();
    for (const double t : ticks(rx, ticks_over(w, 60.0)))
      out += segment("grid", to_x(t), kTop, to_x(t), bottom) +
             text_at(to_x(t), bottom + 14, "middle", number(t));
    for (const double t : ticks(ry, ticks_over(h, 45.0)))
      out += segment("grid", left, to_y(t), left + w, to_y(t)) +
             text_at(left - 4, to_y(t) + 4, "end", number(t));
    out += text_at(left, kTop - 8, "start", v.title) + text_at(left + w, bottom + 28, "end", "m");
    for (const SpaceLine& line : space_lines(b, with_base)) {
      std::string d;
      for (const std::vector<std::size_t>& rows : shown.rows) {
        bool drawing = false;
        for (const std::size_t k : rows) {
          const Point& p = (*line.points)[k];
          const bool inside = finite(p) && p[v.across] > rx.low && p[v.across] < rx.high &&
                              p[v.up] > ry.low && p[v.up] < ry.high;
          if (inside)
            d += (drawing ? "L" : "M") + coordinate(to_x(p[v.across])) + " " +
                 coordinate(to_y(p[v.up]));
          drawing = inside;
        }
      }
      out += std::string("<path class='") + line.css_class + "' d='" + d + "'/>";
    }
    left += w + kGap;
  }
  return out + "</svg>\n";
}

std::string space_json(const BallSeries& b, const ShownPath& shown, bool with_base) {
  std::string out = "{";
  for (const SpaceLine& line : space_lines(b, with_base)) {
    out += (out.size() > 1 ? ",\"" : "\"") + std::string(line.css_class) + "\":[";
    for (std::size_t w = 0; w < shown.rows.size(); ++w) {
      out += w ? ",[" : "[";
      for (std::size_t i = 0; i < shown.rows[w].size(); ++i) {
        const Point& p = (*line.points)[shown.rows[w][i]];
        char text[64];
        detail::print(text, sizeof text, "[%.4f,%.4f,%.4f]", p[0], p[1], p[2]);
        out += (i ? "," : "") + (finite(p) ? std::string(text) : std::string("null"));
      }
      out += "]";
    }
    out += "]";
  }
  return out + "}";
}

// --- the sphere of directions

namespace {

constexpr int kCells = 21;  ///< of the map, from side to side
/// Rows that a cell's mean needs, where there are many.
constexpr int kLeastRows = 3;
constexpr std::size_t kManyRows = 400;
/// What noise alone exceeds in 5 % of the cells: mean of n vectors of two coordinates, in σ/√n
/// (Rayleigh).
constexpr double kArrowSigmas = 2.45;

struct Cell {
  double along = 0.0, x = 0.0, y = 0.0;  ///< mean error [m]; x, y: across, in the map
  int rows = 0;
};
struct SphereMap {
  std::array<Cell, kCells * kCells> cells;
  double along_rms = 0.0, across_rms = 0.0;  ///< of all rows [m]
  int rows = 0;
};

/// A unit vector in the map: straight down in the middle, straight up at distance 2.
std::array<double, 2> mapped(const Point& u) {
  const double s = std::sqrt(2.0 / std::max(1.0 - u[2], 1e-9));
  return {u[0] * s, u[1] * s};
}

Point direction(const BallSeries& b, std::size_t k) {
  const Point d = minus(b.measured[k], b.anchor[k]);
  const double r = std::sqrt(dot(d, d));
  return {d[0] / r, d[1] / r, d[2] / r};  // NaN at the anchor itself
}

SphereMap mean_errors(const BallSeries& b, const std::vector<Point>& model, double radius) {
  SphereMap out;
  for (std::size_t k = 0; k < b.time.size(); ++k) {
    const Point u = direction(b, k), e = minus(b.measured[k], model[k]);
    if (!finite(u) || !finite(e)) continue;
    const double along = dot(u, e);
    const Point across{e[0] - along * u[0], e[1] - along * u[1], e[2] - along * u[2]};
    const double size = std::sqrt(dot(across, across));
    const std::array<double, 2> at = mapped(u);
    const auto index = [&](double v) {
      return std::clamp(static_cast<int>((v / radius + 1.0) * 0.5 * kCells), 0, kCells - 1);
    };
    Cell& cell = out.cells[static_cast<std::size_t>(index(at[1]) * kCells + index(at[0]))];
    cell.along += along;
    if (size > 0.0) {  // its direction in the map, by a small step
      constexpr double kStep = 1e-4;
      Point next;
      for (std::size_t c = 0; c < 3; ++c) next[c] = u[c] + kStep * across[c] / size;
      const double r = std::sqrt(dot(next, next));
      const std::array<double, 2> to = mapped({next[0] / r, next[1] / r, next[2] / r});
      const double dx = to[0] - at[0], dy = to[1] - at[1], d = std::hypot(dx, dy);
      cell.x += size * dx / d;
      cell.y += size * dy / d;
    }
    ++cell.rows;
    ++out.rows;
    out.along_rms += along * along;
    out.across_rms += size * size;
  }
  for (Cell& c : out.cells) {
    const double n = std::max(c.rows, 1);
    c = {c.along / n, c.x / n, c.y / n, c.rows};
  }
  out.along_rms = std::sqrt(out.along_rms / std::max(out.rows, 1));
  out.across_rms = std::sqrt(out.across_rms / std::max(out.rows, 1));
  return out;
}

/// A round number that most of the values do not exceed: 1, 2 or 5 times a power of ten.
double round_scale(std::vector<double> values) {
  std::erase_if(values, [](double x) { return !std::isfinite(x); });
  if (values.empty()) return 1e-3;
  std::ranges::sort(values);
  const double most = std::max(values[(values.size() - 1) * 95 / 100], 1e-6);
  const double power = std::pow(10.0, std::floor(std::log10(most)));
  for (const double step : {1.0, 2.0, 5.0})
    if (most <= step * power) return step * power;
  return 10.0 * power;
}

/// White at 0, blue where the ball is nearer than the model has it, vermilion where it is farther.
std::string colour(double share) {
  constexpr std::array<double, 3> kNear{0, 90, 160}, kFar{205, 80, 0}, kNone{250, 250, 250};
  const double s = std::clamp(std::abs(share), 0.0, 1.0);
  const auto& end = share < 0.0 ? kNear : kFar;
  char text[16];
  const auto mix = [&](std::size_t c) {
    return static_cast<unsigned>(std::lround(kNone[c] + s * (end[c] - kNone[c])));
  };
  detail::print(text, sizeof text, "#%02x%02x%02x", mix(0), mix(1), mix(2));
  return text;
}

std::string millimetres(double metres, int digits = 3) { return number(1e3 * metres, digits); }

/// An arrow from one point to another, its head included.
std::string arrow(double x, double y, double dx, double dy) {
  const double length = std::hypot(dx, dy), head = std::min(3.5, 0.5 * length);
  if (!(length > 1.0)) return "";
  const double ux = dx / length, uy = dy / length;
  const auto point = [](double px, double py) { return coordinate(px) + " " + coordinate(py); };
  return "M" + point(x, y) + "L" + point(x + dx, y + dy) + "M" +
         point(x + dx - head * (ux - 0.6 * uy), y + dy - head * (uy + 0.6 * ux)) + "L" +
         point(x + dx, y + dy) + "L" +
         point(x + dx - head * (ux + 0.6 * uy), y + dy - head * (uy - 0.6 * ux));
}

}  // namespace

std::string sphere(const BallSeries& b, const std::string& before, const std::string& after,
                   bool with_base) {
  constexpr double kSize = 330.0, kTop = 34.0, kMargin = 18.0;
  if (!b.has_string) return "";
  double radius = 0.0;
  std::size_t rows = 0;
  for (std::size_t k = 0; k < b.time.size(); ++k)
    if (const Point u = direction(b, k); finite(u)) {
      const std::array<double, 2> at = mapped(u);
      radius = std::max(radius, std::hypot(at[0], at[1]));
      ++rows;
    }
  if (rows == 0) return "";
  radius = std::min(std::max(1.05 * radius, 0.05), 2.0);
  struct Panel {
    std::string title;
    SphereMap map;
  };
  std::vector<Panel> panels;
  if (with_base) panels.push_back({before, mean_errors(b, b.base, radius)});
  panels.push_back({after, mean_errors(b, b.extended, radius)});

  const int least = rows < kManyRows ? 1 : kLeastRows;
  std::vector<double> along, across;
  for (const Panel& p : panels)
    for (const Cell& c : p.map.cells)
      if (c.rows >= least) {
        along.push_back(std::abs(c.along));
        across.push_back(std::hypot(c.x, c.y));
      }
  if (along.empty()) return "";
  const double full = round_scale(along), long_arrow = round_scale(across);
  const double cell = kSize / kCells, arrow_scale = 1.5 * cell / long_arrow;

  const double height = kTop + kSize + 12.0;
  std::string out = "<svg class='sphere' viewBox='0 0 " + coordinate(kWidth) + " " +
                    coordinate(height) + "' role='img'>";
  double left = kMargin;
  for (const Panel& p : panels) {
    const double cx = left + 0.5 * kSize, cy = kTop + 0.5 * kSize, scale = 0.5 * kSize / radius;
    out += text_at(cx, 12, "middle", p.title) +
           text_at(cx, 26, "middle",
                   "rms along the string " + millimetres(p.map.along_rms) + " mm, across it " +
                       millimetres(p.map.across_rms) + " mm");
    std::string arrows;
    for (int row = 0; row < kCells; ++row)
      for (int column = 0; column < kCells; ++column) {
        const Cell& c = p.map.cells[static_cast<std::size_t>(row * kCells + column)];
        if (c.rows < least) continue;
        const double x = left + column * cell, y = kTop + (kCells - 1 - row) * cell;
        out += "<path class='cell' style='fill:" + colour(c.along / full) + "' d='M" +
               coordinate(x) + " " + coordinate(y) + "h" + coordinate(cell) + "v" +
               coordinate(cell) + "h-" + coordinate(cell) + "z'/>";
        const double length = std::hypot(c.x, c.y);
        if (length * std::sqrt(c.rows) < kArrowSigmas * b.sigma) continue;
        const double shown = length > 0.0 ? std::min(length, 2.0 * long_arrow) / length : 0.0;
        const double dx = c.x * shown * arrow_scale, dy = -c.y * shown * arrow_scale;
        arrows += arrow(x + 0.5 * cell - 0.5 * dx, y + 0.5 * cell - 0.5 * dy, dx, dy);
      }
    for (const int degrees : {15, 30, 45, 60, 90, 120, 150}) {
      const double r = 2.0 * std::sin(degrees * M_PI / 360.0);
      if (r > radius || (degrees % 30 == 15 && radius > 1.1)) continue;
      out += "<circle class='around' cx='" + coordinate(cx) + "' cy='" + coordinate(cy) + "' r='" +
             coordinate(r * scale) + "'/>" +
             text_at(cx + 0.7071 * r * scale + 2, cy - 0.7071 * r * scale - 2, "start",
                     std::to_string(degrees) + "°");
    }
    out += segment("zero", cx - 0.5 * kSize, cy, cx + 0.5 * kSize, cy) +
           segment("zero", cx, cy - 0.5 * kSize, cx, cy + 0.5 * kSize) +
           text_at(cx + 0.5 * kSize + 3, cy + 4, "start", "x") +
           text_at(cx + 4, cy - 0.5 * kSize + 8, "start", "y");
    out += "<path class='arrow' d='" + arrows + "'/>";
    left += kSize + 2.0 * kMargin;
  }
  // The scales.
  const double x = left + 14.0, bar = 160.0, top = kTop + 40.0;
  out +=
      text_at(x, top - 22, "start", "mean along the string") + text_at(x, top - 8, "start", "[mm]");
  constexpr int kSteps = 20;
  for (int k = 0; k < kSteps; ++k)
    out += "<path class='cell' style='fill:" + colour(1.0 - (2.0 * k + 1.0) / kSteps) + "' d='M" +
           coordinate(x) + " " + coordinate(top + k * bar / kSteps) + "h14v" +
           coordinate(bar / kSteps) + "h-14z'/>";
  out += text_at(x + 20, top + 6, "start", "+" + millimetres(full) + " ball farther") +
         text_at(x + 20, top + 0.5 * bar + 4, "start", "0") +
         text_at(x + 20, top + bar + 2, "start", "−" + millimetres(full) + " ball nearer") +
         text_at(x, top + bar + 36, "start", "mean across it") + "<path class='arrow' d='" +
         arrow(x, top + bar + 50, long_arrow * arrow_scale, 0.0) + "'/>" +
         text_at(x + long_arrow * arrow_scale + 6, top + bar + 54, "start",
                 millimetres(long_arrow) + " mm");
  return out + "</svg>\n";
}

}  // namespace diffnea::report
