#include <diffnea/report/movement_gif.hpp>

#ifdef DIFFNEA_HAS_GIF

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <gif_lib.h>
#include <memory>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text_file.hpp>

#include "report/policy_words.hpp"
#include "report/stick_views.hpp"

namespace diffnea {
namespace {

using namespace report;

constexpr int kWidth = 360, kMargin = 10;
constexpr int kDelay = 4;  ///< of a frame [1/100 s]

enum Colour : std::uint8_t { kPaper, kArm, kCup, kString, kObtained, kImagined, kBall, kRule };
constexpr std::array<std::array<std::uint8_t, 3>, 8> kPalette{{{255, 255, 255},
                                                               {85, 85, 102},
                                                               {34, 34, 51},
                                                               {136, 136, 153},
                                                               {0, 114, 178},
                                                               {239, 176, 74},
                                                               {179, 38, 30},
                                                               {221, 221, 238}}};

/// A picture of few colours; y grows downward.
class Canvas {
 public:
  Canvas(int width, int height) : width_(width), height_(height), pixels_(size()) {}

  void disc(double x, double y, double radius, Colour colour) {
    const int from_y = static_cast<int>(std::ceil(y - radius)),
              to_y = static_cast<int>(std::floor(y + radius));
    for (int j = std::max(from_y, 0); j <= std::min(to_y, height_ - 1); ++j) {
      const double half = std::sqrt(std::max(radius * radius - (j - y) * (j - y), 0.0));
      const int from = std::max(static_cast<int>(std::ceil(x - half)), 0),
                to = std::min(static_cast<int>(std::floor(x + half)), width_ - 1);
      for (int i = from; i <= to; ++i)
        pixels_[static_cast<std::size_t>(j) * static_cast<std::size_t>(width_) +
                static_cast<std::size_t>(i)] = colour;
    }
  }
  /// Discs half a pixel apart.
  void line(double x1, double y1, double x2, double y2, double thick, Colour colour) {
    const int steps = 1 + static_cast<int>(2.0 * std::hypot(x2 - x1, y2 - y1));
    for (int k = 0; k <= steps; ++k) {
      const double s = static_cast<double>(k) / steps;
      disc(x1 + s * (x2 - x1), y1 + s * (y2 - y1), 0.5 * thick, colour);
    }
  }
  std::uint8_t* row(int j) { return pixels_.data() + static_cast<long>(j) * width_; }
  int width() const { return width_; }
  int height() const { return height_; }

 private:
  std::size_t size() const {
    return static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_);
  }
  int width_, height_;
  std::vector<std::uint8_t> pixels_;
};

struct Scene {
  const StickFigure& figure;
  const StickFigure* ghost;
  Stage stage;
  double scale = 1.0;
  int height = 0;

  double x(double across) const { return kMargin + scale * (across - stage.across.low); }
  double y(double up) const { return height - kMargin - scale * (up - stage.up.low); }
};

Scene scene(const StickFigure& figure, const StickFigure* ghost) {
  Scene out{.figure = figure, .ghost = ghost, .stage = stage({&figure, ghost})};
  out.scale = (kWidth - 2 * kMargin) / out.stage.across.width();
  // Not higher than twice its width.
  out.scale = std::min(out.scale, 2.0 * kWidth / out.stage.up.width());
  out.height = 2 * kMargin + static_cast<int>(std::lround(out.scale * out.stage.up.width()));
  return out;
}

void paths(const StickFigure& f, long to, const Scene& s, Colour colour, Canvas& canvas) {
  const long ball = f.across.cols() - 1;
  for (long k = 1; k <= std::min(to, f.time.size() - 1); ++k)
    canvas.line(s.x(f.across(k - 1, ball)), s.y(f.up(k - 1, ball)), s.x(f.across(k, ball)),
                s.y(f.up(k, ball)), 1.5, colour);
}

Canvas frame(const Scene& s, long row) {
  const StickFigure& f = s.figure;
  Canvas out(kWidth, s.height);
  const auto line = [&](long from, long to, double thick, Colour colour) {
    out.line(s.x(f.across(row, from)), s.y(f.up(row, from)), s.x(f.across(row, to)),
             s.y(f.up(row, to)), thick, colour);
  };
  const double done = static_cast<double>(row) / static_cast<double>(f.time.size() - 1);
  out.line(0, s.height - 2, kWidth, s.height - 2, 3, kRule);  // how far it is
  out.line(0, s.height - 2, kWidth * done, s.height - 2, 3, kString);
  if (s.ghost) paths(*s.ghost, row, s, kImagined, out);
  paths(f, row, s, kObtained, out);
  for (int i = 1; i < f.arm_points(); ++i) line(i - 1, i, 4, kArm);
  const long knot = f.arm_points(), ball = f.across.cols() - 1;
  for (long i = knot + 1; i + 1 < ball; ++i) line(i, i + 1, 2.5, kCup);
  line(knot, ball, 1, kString);
  if (s.ghost) {
    const long k = std::min(row, s.ghost->time.size() - 1), b = s.ghost->across.cols() - 1;
    out.disc(s.x(s.ghost->across(k, b)), s.y(s.ghost->up(k, b)), 4, kImagined);
  }
  out.disc(s.x(f.across(row, ball)), s.y(f.up(row, ball)), 5, kBall);
  return out;
}

int append(GifFileType* gif, const GifByteType* bytes, int count) {
  static_cast<std::string*>(gif->UserData)
      ->append(reinterpret_cast<const char*>(bytes), static_cast<std::size_t>(count));
  return count;
}

void require(int answer, GifFileType* gif) {
  if (answer != GIF_ERROR) return;
  const char* reason = GifErrorString(gif->Error);
  throw Error(std::string("movement.gif: ") + (reason ? reason : "cannot be encoded"));
}

void put(GifFileType* gif, Canvas canvas, int delay) {
  GraphicsControlBlock control{.DisposalMode = DISPOSE_DO_NOT,
                               .UserInputFlag = false,
                               .DelayTime = delay,
                               .TransparentColor = NO_TRANSPARENT_COLOR};
  std::array<GifByteType, 4> extension{};
  EGifGCBToExtension(&control, extension.data());
  require(EGifPutExtension(gif, GRAPHICS_EXT_FUNC_CODE, 4, extension.data()), gif);
  require(EGifPutImageDesc(gif, 0, 0, canvas.width(), canvas.height(), false, nullptr), gif);
  for (int j = 0; j < canvas.height(); ++j)
    require(EGifPutLine(gif, canvas.row(j), canvas.width()), gif);
}

std::string encoded(const Scene& s) {
  std::string out;
  int error = 0;
  const auto close = [](GifFileType* g) { EGifCloseFile(g, nullptr); };
  std::unique_ptr<GifFileType, decltype(close)> gif(EGifOpen(&out, append, &error), close);
  if (!gif) throw Error("movement.gif: cannot be encoded");
  EGifSetGifVersion(gif.get(), true);
  const std::unique_ptr<ColorMapObject, decltype(&GifFreeMapObject)> colours(
      GifMakeMapObject(static_cast<int>(kPalette.size()), nullptr), GifFreeMapObject);
  for (std::size_t i = 0; i < kPalette.size(); ++i)
    colours->Colors[i] = {kPalette[i][0], kPalette[i][1], kPalette[i][2]};
  require(EGifPutScreenDesc(gif.get(), kWidth, s.height, 3, kPaper, colours.get()), gif.get());
  // Again and again (Netscape 2.0).
  const std::array<GifByteType, 3> loop{1, 0, 0};
  require(EGifPutExtensionLeader(gif.get(), APPLICATION_EXT_FUNC_CODE), gif.get());
  require(EGifPutExtensionBlock(gif.get(), 11, "NETSCAPE2.0"), gif.get());
  require(EGifPutExtensionBlock(gif.get(), 3, loop.data()), gif.get());
  require(EGifPutExtensionTrailer(gif.get()), gif.get());
  const VecX<double>& time = s.figure.time;
  const long last = time.size() - 1;
  double next = 0.0;
  for (long k = 0; k <= last; ++k) {
    constexpr double kRounding = 1e-6;  // of sampled times [s]
    if (k < last && time[k] < next - kRounding) continue;
    next = time[k] + 0.01 * kDelay;
    put(gif.get(), frame(s, k), k < last ? kDelay : 100);
  }
  if (EGifCloseFile(gif.release(), &error) == GIF_ERROR)
    throw Error("movement.gif: cannot be encoded");
  return out;
}

}  // namespace

bool can_write_gif() { return true; }

bool write_movement_gif(const TransferRun& run, const std::filesystem::path& path) {
  const Telling shown = telling(run);
  const int index = shown.success >= 0 ? shown.success : shown.failure;
  const std::size_t i = static_cast<std::size_t>(index);
  if (index < 0 || i >= run.figures.size() || run.figures[i].time.size() < 2) return false;
  const bool has_ghost = i < run.imagined_figures.size() && run.imagined_figures[i].time.size() > 0;
  write_file_atomically(
      path, encoded(scene(run.figures[i], has_ghost ? &run.imagined_figures[i] : nullptr)));
  return true;
}

}  // namespace diffnea

#else

namespace diffnea {

bool can_write_gif() { return false; }
bool write_movement_gif(const TransferRun&, const std::filesystem::path&) { return false; }

}  // namespace diffnea

#endif
