/// A diagnosis that is told to stop takes no further look at the data.

#include <algorithm>
#include <string>
#include <vector>

#include <catch2/catch_test_macros.hpp>

#include <diffnea/diagnose/diagnose.hpp>
#include <diffnea/excite/fourier.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/sim/record.hpp>

namespace diffnea::interrupted_test {
namespace {

Recording recorded(const Model& arm, unsigned seed, double noise) {
  FourierOptions motion;
  motion.duration = 10.0;
  motion.seed = seed;
  RecordOptions options;
  options.scale_noise(noise);
  options.seed = seed;
  return record_model(arm, arm, random_fourier(arm, motion), options).recording;
}

/// Stages as progress is told them, and one answer alone is a stop: who hears it must end.
std::vector<std::string> stages(std::size_t stop_at) {
  const Model arm = read_model(DIFFNEA_SOURCE_DIR "/models/double_pendulum.urdf");
  const Recording train = recorded(arm, 1, 0.2), held_out = recorded(arm, 2, 0.6);
  std::vector<std::string> told;
  DiagnoseOptions options;
  options.progress = [&](const FitProgress& p) {
    told.push_back(p.stage);
    return told.size() != stop_at;  // 0: never
  };
  const Finding finding = diagnose(arm, {train}, {held_out}, options);
  CHECK(finding.interrupted == (stop_at > 0 && told.size() >= stop_at));
  return told;
}

}  // namespace

TEST_CASE("diagnose: stopped while it tests or while it simulates, it goes no further",
          "[diagnose]") {
  const std::vector<std::string> whole = stages(0);
  const auto first = std::ranges::find(whole, "testing") - whole.begin();
  REQUIRE(first + 1 < static_cast<std::ptrdiff_t>(whole.size()));
  for (const std::size_t stop_at : {static_cast<std::size_t>(first) + 1, whole.size()}) {
    CAPTURE(stop_at);
    CHECK(stages(stop_at).size() <= stop_at + 1);  // a stage that was begun may say that it ends
  }
}

}  // namespace diffnea::interrupted_test
