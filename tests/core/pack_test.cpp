/// Functions of packs against the standard library's, lane by lane.

#include <algorithm>
#include <cmath>

#include <catch2/catch_test_macros.hpp>

#include <diffnea/core/pack.hpp>
#include <diffnea/core/random.hpp>

using namespace diffnea;

namespace {

/// The largest error of f over g in units in the last place of g, or of `least`.
template <class F, class G>
double worst(const F& f, const G& g, double low, double high, double least = 0.0) {
  Rng rng(1);
  double most = 0.0;
  for (int k = 0; k < 20000; ++k) {
    const double x = k == 0 ? low : k == 1 ? high : k == 2 ? 0.0 : rng.uniform(low, high);
    const double expected = g(x), size = std::max(std::abs(expected), least);
    const double unit = std::nextafter(size, INFINITY) - size;
    most = std::max(most, std::abs(value(f(Pack(x)), kPackWidth - 1) - expected) / unit);
  }
  return most;
}

}  // namespace

TEST_CASE("pack: exp, tanh, sine and cosine are the standard library's to some last places",
          "[core]") {
  const auto power = [](const Pack& x) { return exp_of(x); };
  CHECK(worst(power, [](double x) { return std::exp(x); }, -700.0, 700.0) <= 2.0);
  CHECK(worst(power, [](double x) { return std::exp(x); }, -1.0, 1.0) <= 2.0);
  const auto sign = [](const Pack& x) { return smooth_sign(x); };
  for (const double range : {1e-9, 0.7, 3.0, 100.0})
    CHECK(worst(sign, [](double x) { return std::tanh(x); }, -range, range) <= 4.0);
  const auto sine = [](const Pack& x) {
    Pack s, c;
    sin_cos(x, s, c);
    return s;
  };
  const auto cosine = [](const Pack& x) {
    Pack s, c;
    sin_cos(x, s, c);
    return c;
  };
  // Near a zero what counts is the absolute error: units of ½.
  for (const double range : {1.0, 7.0, 1e4}) {
    CHECK(worst(sine, [](double x) { return std::sin(x); }, -range, range, 0.5) <= 2.0);
    CHECK(worst(cosine, [](double x) { return std::cos(x); }, -range, range, 0.5) <= 2.0);
  }
}
