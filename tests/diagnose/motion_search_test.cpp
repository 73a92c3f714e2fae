/// Fits of sets of causes beside servos: each is done once, and no further than its rivals ask.

#include "diagnose/motion_search.hpp"

#include <catch2/catch_test_macros.hpp>

#include "identify/drives.hpp"
#include "identify/passes.hpp"
#include "support/servo_bench.hpp"

namespace diffnea::motion_search_test {
namespace {

/// A pendulum on a servo and a spring.
constexpr test::SprungServo kBench{.spring = 0.6};

/// The bench without its spring, fitted, and what a search works on.
struct Fitted {
  Model model = test::servo_bench(kBench.mass, kBench.length, kBench.inertia);
  std::unique_ptr<RecordingSource> train = recordings_in_memory(model, {kBench.record(6.0)});
  MotionSearchData data = prepared();
  int steps = 0;  ///< number in all fits

  MotionSearchData prepared() {
    IdentifyOptions options;
    std::vector<std::string> notes;
    fit_drives(model, *train, options, notes);
    model = identify_by_motion(model, *train, nullptr, options).model;
    return {*train,
            nullptr,
            options.choice,
            options.motion,
            motion_data(model, *train, nullptr, {true}, notes),
            1.0};
  }
  MotionSearch search() {
    return {model, data, {}, [this](const std::string&, int more) {
              steps += more;
              return true;
            }};
  }
};

const std::vector<EffectSpec> kSpring{{"joint_spring", "servo", {}}},
    kDrag{{"quadratic_friction", "servo", {}}};

}  // namespace

TEST_CASE("motion search: a set of causes is fitted once from the same fit", "[diagnose]") {
  Fitted of;
  MotionSearch search = of.search();
  const MotionSolution base = search.solve({}, nullptr);
  REQUIRE(of.steps > 0);
  const MotionSolution spring = search.solve(kSpring, &base);
  REQUIRE(spring.cost < base.cost);
  int steps = of.steps;
  CHECK(search.solve(kSpring, &base).cost == spring.cost);
  CHECK(of.steps == steps);
  // From beside the spring the base may come to another fit; the better one is its own.
  const MotionSolution back = search.solve({}, &spring);
  CHECK(of.steps > steps);
  CHECK(back.cost <= base.cost);
  steps = of.steps;
  CHECK(search.solve({}, &spring).cost == back.cost);
  CHECK(of.steps == steps);
}

TEST_CASE("motion search: a rival out of reach is stopped, and goes on where more is asked",
          "[diagnose]") {
  Fitted of;
  MotionSearch search = of.search();
  const MotionSolution base = search.solve({}, nullptr), spring = search.solve(kSpring, &base);
  const double to_beat = search.reach(base, spring, 10.0);
  REQUIRE(to_beat > spring.cost);
  of.steps = 0;
  const MotionSolution stopped = search.solve(kDrag, &base, to_beat);
  const int few = of.steps;
  CHECK(stopped.cost > to_beat);
  CHECK(search.solve(kDrag, &base, spring.cost).cost == stopped.cost);
  CHECK(of.steps == few);
  const MotionSolution whole = search.solve(kDrag, &base);
  CHECK(of.steps - few > few);
  CHECK(whole.cost <= stopped.cost);
  CHECK(whole.cost > to_beat);  // it was out of reach
}

}  // namespace diffnea::motion_search_test
