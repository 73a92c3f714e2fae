/// Offsets of runs that chance does not make.

#include "diagnose/sessions.hpp"

#include <support/swinging.hpp>

#include <catch2/catch_test_macros.hpp>

#include "diagnose/noise.hpp"

namespace diffnea::sessions_test {
namespace {

constexpr long kElbow = 1;

/// Runs of ten seconds.
struct Runs {
  explicit Runs(int count = 4, double seconds = 10.0)
      : model(read_model(DIFFNEA_SOURCE_DIR "/models/double_pendulum.urdf")) {
    std::vector<Recording> recordings;
    for (int run = 0; run < count; ++run) {
      recordings.push_back(test::swinging(model, seconds, false, 1));
      recordings.back().run = run;
      recordings.back().source += std::to_string(run);
    }
    source = recordings_in_memory(model, recordings);
    FitChoice choice;
    choice.effects = std::vector<std::string>{};
    std::vector<std::string> notes;
    const FitLayout layout = layout_for(model, *source, nullptr, choice, notes);
    PreprocessOptions preprocess;
    preprocess.filter_hz = 8.0;
    preprocess.decimate_to_hz = 25.0;
    preprocess.min_segment = 0.0;
    evidence = std::make_unique<Evidence>(model, Linearisation{model}, layout, *source,
                                          plan_preprocess(source->sample(), preprocess), 0.0,
                                          IdentifyOptions{});
  }
  /// An error that hangs together over half a second or so, as what a model lacks does, and
  /// `offset` times the run's number.
  VecX<double> errors(double offset, unsigned seed) const {
    const double memory = 0.9;  // from row to row, at 25 Hz
    Rng rng(seed);
    VecX<double> out(evidence->rows());
    double e = 0.0;
    for (long row = 0; row < out.size(); ++row) {
      e = memory * e + std::sqrt(1.0 - memory * memory) * rng.normal();
      out[row] =
          e + offset * evidence->stretch()[static_cast<std::size_t>(row % evidence->times())];
    }
    return out;
  }
  std::vector<bool> all() const {
    return std::vector<bool>(static_cast<std::size_t>(evidence->rows()), true);
  }

  Model model;
  std::unique_ptr<RecordingSource> source;
  std::unique_ptr<Evidence> evidence;
};

}  // namespace

TEST_CASE("sessions: runs that differ do so beyond chance", "[diagnose]") {
  const Runs runs;
  CHECK(sessions_alike(*runs.evidence, runs.errors(1.0, 1), runs.all(), kElbow, 0) == 0.0);
}

TEST_CASE("sessions: runs of one block tell no offset of their own, whatever they have",
          "[diagnose]") {
  const Runs longer(4, 1.5), shorter(12, 0.8);
  CHECK(tells_sessions(*longer.evidence));
  CHECK_FALSE(tells_sessions(*shorter.evidence));
  CHECK(sessions_alike(*shorter.evidence, shorter.errors(1.0, 1), shorter.all(), kElbow, 0) == 1.0);
}

TEST_CASE("sessions: an error that hangs together is no offset of a run", "[diagnose]") {
  const Runs runs;
  int below = 0;
  constexpr int kSeeds = 100;
  for (unsigned seed = 1; seed <= kSeeds; ++seed)
    below +=
        sessions_alike(*runs.evidence, runs.errors(0.0, seed), runs.all(), kElbow, seed) < 0.05;
  // Five of 100 draws are expected, 16 in one of 10^5 (binomial); blocks of a second still hang
  // together a little, which doubles the rate.
  CHECK(below < 20);
}

TEST_CASE("sessions: what a run has of its own is not taken for noise", "[diagnose]") {
  const Runs runs;
  std::vector<int> free(static_cast<std::size_t>(runs.evidence->base().cols()));
  for (std::size_t k = 0; k < free.size(); ++k) free[k] = static_cast<int>(k);
  const VecX<double> x0 = VecX<double>::Zero(runs.evidence->base().cols());
  const auto left = [&](double offset) {
    return beside_smooth_functions(*runs.evidence, free, x0, runs.errors(offset, 3), runs.all(),
                                   0.0)
        .left;
  };
  const VecX<double> without = left(0.0);
  CHECK((left(5.0) - without).norm() < 1e-6 * without.norm());
}

}  // namespace diffnea::sessions_test
