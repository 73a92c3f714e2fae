/// The choice of causes by simulated windows: it ends, and hears of an interruption.

#include "diagnose/window_selection.hpp"

#include <catch2/catch_test_macros.hpp>

namespace diffnea::window_selection_test {
namespace {

/// Windows that every cause makes better by as much.
struct Alike {
  struct Solution {
    std::vector<EffectSpec> terms;
    double cost = 1000.0;
  };
  Solution solve(const std::vector<EffectSpec>& terms, const Solution*, double = 0.0) const {
    return {terms, 1000.0 - 100.0 * static_cast<double>(terms.size())};
  }
  double reach(const Solution&, const Solution& best, double) const { return best.cost; }
  std::vector<WindowScore> scores(const Solution& s, const std::vector<EffectSpec>& all) const {
    std::vector<WindowScore> out;
    for (const EffectSpec& e : all)
      if (!holds_effect(s.terms, e)) out.push_back({e, 100.0, 100.0, 100.0, 1.0, 1.0, {}});
    return out;
  }
  double delta_bic(const Solution& a, const Solution& b) const { return a.cost - b.cost; }
  HeldOutChange held_out(const Solution&, const Solution&, std::uint64_t) const {
    return {2.0, 1.0, 0.4, 0.6, 1.0};
  }
  bool is_far_from_linear(const EffectSpec&) const { return false; }
};

struct Case {
  DiagnoseOptions options;
  Finding finding;
  WindowCase<Alike> windows{options, finding};

  Case() {
    windows.search = std::make_unique<Alike>();
    windows.candidates = {{"cogging", "wrist", {}}, {"joint_spring", "wrist", {}}};
    windows.base = windows.best = windows.search->solve({}, nullptr);
    windows.first_scores = windows.search->scores(windows.base, windows.candidates);
  }
};

}  // namespace

TEST_CASE("window selection: a cause that is dropped each time it was added ends it",
          "[diagnose]") {
  Case c;
  int added = 0;
  select_windows(c.windows, 8, [&] {
    REQUIRE(++added < 10);
    c.windows.best = c.windows.search->solve({}, nullptr);
  });
  CHECK(c.windows.best.terms.empty());
}

TEST_CASE("window selection: what helps is added, up to as many as are asked for", "[diagnose]") {
  for (const std::size_t most : {1u, 8u}) {
    Case c;
    select_windows(c.windows, most);
    CHECK(c.windows.best.terms.size() == std::min<std::size_t>(most, 2));
  }
}

TEST_CASE("window selection: each round asks whether to go on", "[diagnose]") {
  Case c;
  int asked = 0;
  c.options.progress = [&](const FitProgress&) { return ++asked < 2; };
  select_windows(c.windows, 8);
  CHECK(c.finding.interrupted);
  CHECK(c.windows.best.terms.size() == 1);
}

}  // namespace diffnea::window_selection_test
