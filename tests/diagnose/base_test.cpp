/// What the base of a diagnosis takes from a recording by itself.

#include <algorithm>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>

#include <diffnea/diagnose/diagnose.hpp>
#include <diffnea/excite/fourier.hpp>
#include <diffnea/identify/identify.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/sim/record.hpp>

#include "identify/fingerprint.hpp"

namespace diffnea::base_test {
namespace {

constexpr double kTurn = 0.05;  ///< v₀ [rad/s]

Model with_friction(double v0) {
  Model out = read_model(DIFFNEA_SOURCE_DIR "/models/double_pendulum.urdf");
  for (const char* joint : {"shoulder", "elbow"})
    out.effects.push_back(
        {"coulomb_friction", joint, {{"coulomb", 0.4, ""}, {"smoothing", v0, ""}}});
  return out;
}

Recording record(unsigned seed) {
  const Model truth = with_friction(kTurn);
  FourierOptions motion;
  motion.seed = seed;
  motion.duration = 20.0;
  motion.period = 5.0;
  RecordOptions options;
  options.seed = seed;
  options.period = 5.0;
  options.scale_noise(0.1);
  return record_model(truth, truth, random_fourier(truth, motion), options).recording;
}

}  // namespace

TEST_CASE("diagnose: a base whose friction turns a little too slowly is corrected once",
          "[diagnose]") {
  DiagnoseOptions options;
  options.effects = {"quadratic_friction"};
  const Recording train = record(1), test = record(2);
  /// v₀ of shoulder and elbow, as the finding's model and its parameters have it.
  const auto turns = [&](double v0) {
    const Finding f = diagnose(with_friction(v0), {train}, {test}, options);
    CHECK(f.verdict == Verdict::kNone);
    std::vector<double> out, told;
    for (const EffectSpec& e : f.model.effects)
      for (const EffectParameter& p : e.parameters)
        if (p.name == "smoothing") out.push_back(p.value);
    for (const ParameterEstimate& p : f.parameters)
      if (p.name.ends_with("smoothing")) told.push_back(p.value);
    REQUIRE(out.size() == 2);
    CHECK(out == told);
    return out;
  };
  // From far off, it is read anew until it stays. Filters let it look 7 % slower than it is.
  const std::vector<double> read = turns(1.6 * kTurn);
  for (const double v0 : read) CHECK_THAT(v0, Catch::Matchers::WithinRel(kTurn, 0.1));
  for (const double factor : {1.0, 1.12}) {
    CAPTURE(factor);
    const std::vector<double> near = turns(factor * kTurn);
    for (std::size_t k = 0; k < 2; ++k)  // half of what correcting it twice would add
      CHECK_THAT(near[k], Catch::Matchers::WithinRel(read[k], 0.03));
  }
}

TEST_CASE("diagnose: a model that cannot know its own recording says to take --base refit",
          "[diagnose]") {
  DiagnoseOptions options;
  options.effects = {"viscous_friction"};
  const Recording own = record(1), other = record(2);
  Model model = identify(with_friction(kTurn), {own}, {}).model;
  REQUIRE(model.posterior);
  std::vector<std::string>& recordings = model.posterior->recordings;
  REQUIRE(recordings.size() == 1);
  const auto base = [&](const Recording& of, bool noted) {
    const Finding f = diagnose(model, {of}, {}, options);
    CHECK(noted == std::ranges::any_of(f.notes, [](const std::string& note) {
            return note.starts_with("the model does not say which recordings") &&
                   note.ends_with("take --base refit");
          }));
    return f.base;
  };
  CHECK(base(own, false) == "refit");
  CHECK(base(other, false) == "prior");
  SECTION("an earlier version's fingerprints are of more than the motion") {
    recordings[0] = recordings[0].substr(kOfMotion.size());
  }
  SECTION("a still earlier version wrote none") { recordings.clear(); }
  CHECK(base(own, true) == "prior");
  options.base = Base::kRefit;  // as it says
  CHECK(base(own, false) == "refit");
}

}  // namespace diffnea::base_test
