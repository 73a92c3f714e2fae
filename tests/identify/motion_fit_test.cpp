/// Output error on simulated double pendulums: exact data come back exactly, and derivatives are
/// right.

#include "identify/motion_fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <catch2/catch_approx.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/excite/fourier.hpp>
#include <diffnea/identify/identify.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/sim/record.hpp>

#include "support/found.hpp"

namespace motion_fit_test {

using namespace diffnea;
using Catch::Approx;
using Catch::Matchers::ContainsSubstring;
using diffnea::test::find;

namespace {

Model pendulum_with_friction(double coulomb, double viscous) {
  Model model = read_model(std::string(DIFFNEA_SOURCE_DIR) + "/models/double_pendulum.urdf");
  for (const char* joint : {"shoulder", "elbow"}) {
    // A wide smoothing: the simulator and the fit then step over the same smooth friction.
    model.effects.push_back(
        {"coulomb_friction", joint, {{"coulomb", coulomb, ""}, {"smoothing", 0.2, ""}}});
    model.effects.push_back({"viscous_friction", joint, {{"viscous", viscous, ""}}});
  }
  return model;
}

Recording swing(const Model& model, double noise, unsigned seed = 4) {
  FourierOptions motion;
  motion.duration = 10.0;
  motion.seed = seed;
  RecordOptions options;
  options.position_noise = noise;
  options.torque_noise = 0.0;
  return record_model(model, model, random_fourier(model, motion), options).recording;
}

IdentifyOptions motion_options() {
  IdentifyOptions options;
  options.loss = Loss::kMotion;
  options.choice.effects = std::vector<std::string>{};
  options.motion.horizon = 0.4;
  return options;
}

}  // namespace

TEST_CASE("motion fit: noise-free windows are reproduced, friction and inertia found",
          "[identify]") {
  const Model truth = pendulum_with_friction(0.12, 0.05);
  Model start = pendulum_with_friction(0.05, 0.02);
  for (ModelLink& link : start.links) link.inertia.h = link.inertia.h * 1.1;
  const Recording data = swing(truth, 0.0);
  const IdentifyResult result = identify(start, {data}, {}, motion_options());
  CHECK(result.summary.converged);
  // Friction is what torque and motion show together; 1 % is the integrators' difference at 2 ms.
  CHECK(find(result, "elbow.coulomb_friction.coulomb").value == Approx(0.12).epsilon(0.02));
  CHECK(find(result, "shoulder.viscous_friction.viscous").value == Approx(0.05).epsilon(0.05));
  for (const JointError& e : result.errors) {
    CHECK(e.train < 1e-4);  // [rad]
    CHECK(e.train < 0.05 * e.nominal_train);
  }
  REQUIRE(data.rows() > static_cast<long>(kMaxSeriesRows));
  for (const TorqueSeries& s : result.train_series) CHECK(s.time.size() == kMaxSeriesRows);
}

TEST_CASE("motion fit: with encoder noise the residual is the noise", "[identify]") {
  const Model truth = pendulum_with_friction(0.12, 0.05);
  const IdentifyResult result =
      identify(pendulum_with_friction(0.05, 0.02), {swing(truth, 1e-3)}, {}, motion_options());
  for (const JointError& e : result.errors) CHECK(e.train == Approx(1e-3).epsilon(0.05));
  const ParameterEstimate& coulomb = find(result, "elbow.coulomb_friction.coulomb");
  REQUIRE(coulomb.std > 0.0);
  CHECK(std::abs(coulomb.value - 0.12) < 4.0 * coulomb.std + 0.002);
}

TEST_CASE("motion fit: the result does not depend on the number of threads",
          "[identify][threads]") {
  const Recording data = swing(pendulum_with_friction(0.12, 0.05), 1e-3);
  IdentifyOptions one = motion_options(), two = motion_options();
  two.motion.threads = 2;
  const Model start = pendulum_with_friction(0.05, 0.02);
  const IdentifyResult a = identify(start, {data}, {}, one), b = identify(start, {data}, {}, two);
  for (std::size_t k = 0; k < a.parameters.size(); ++k)
    CHECK(a.parameters[k].value == b.parameters[k].value);
}

TEST_CASE("motion fit: torques of drives whose constants are known to be off", "[identify]") {
  const auto with_gain = [](Model model) {
    model.effects.push_back({"torque_gain", "shoulder", {{"gain_error", 0.2, ""}}});
    model.effects.push_back({"torque_gain", "elbow", {{"gain_error", -0.1, ""}}});
    return model;
  };
  const Recording data = swing(with_gain(pendulum_with_friction(0.12, 0.05)), 0.0);
  const Model start = pendulum_with_friction(0.05, 0.02);
  IdentifyOptions options = motion_options();
  CHECK_THROWS_WITH(identify(with_gain(start), {data}, {}, options),
                    ContainsSubstring("does not fit torque gains") && ContainsSubstring("--fix"));
  options.choice.fix = {"*torque_gain*"};
  const IdentifyResult result = identify(with_gain(start), {data}, {}, options);
  CHECK(result.summary.converged);
  // As without gains: friction is of the recorded torque, and so is the simulator's.
  CHECK(find(result, "elbow.coulomb_friction.coulomb").value == Approx(0.12).epsilon(0.02));
  CHECK(find(result, "shoulder.viscous_friction.viscous").value == Approx(0.05).epsilon(0.05));
  for (const JointError& e : result.errors) CHECK(e.train < 1e-4);  // [rad]
}

TEST_CASE("identify: a passive joint is fitted, not wished away", "[identify]") {
  // With τ = 0 at the elbow a massless lower link leaves no residual there; the shoulder knows
  // better.
  Model truth = read_model(std::string(DIFFNEA_SOURCE_DIR) + "/models/double_pendulum.urdf");
  truth.links[static_cast<std::size_t>(moving_links(truth)[1])].passive = true;
  const Recording data = swing(truth, 1e-5);
  Model start = truth;
  for (ModelLink& link : start.links) link.inertia.m *= 1.1;
  IdentifyOptions options;
  options.choice.effects = std::vector<std::string>{};
  const IdentifyResult result = identify(start, {data}, {}, options);
  CHECK(result.summary.converged);
  CHECK(result.errors[0].train < 0.02 * result.errors[0].torque_rms);
  const double h = make_tree(truth).links[1].inertia.h.z;
  CHECK(find(result, "lower.hz").value == Approx(h).epsilon(0.05));
}

TEST_CASE("motion fit: a window in which a hand moved the joint is named", "[identify]") {
  const Model truth = pendulum_with_friction(0.12, 0.05);
  Recording data = swing(truth, 1e-5);
  // From 6.0 to 6.4 s the elbow is led along another way; no torque tells of it.
  for (long k = 0; k < data.rows(); ++k)
    if (const double t = data.time[k]; t > 6.0 && t < 6.4)
      data.q(k, 1) += 0.05 * std::pow(std::sin((t - 6.0) / 0.4 * 3.14159265358979), 4);
  const IdentifyResult result = identify(truth, {data}, {}, motion_options());
  const auto named = [](const IdentifyResult& r) {
    const auto it = std::ranges::find_if(
        r.notes, [](const std::string& n) { return n.find("does not reproduce") != n.npos; });
    return it == r.notes.end() ? std::string() : *it;
  };
  const std::string note = named(result);
  INFO(note);
  CHECK(note.find("elbow from ") != note.npos);
  // Windows are 0.4 s long and begin with the first filtered row.
  CHECK((note.find(" 5.") != note.npos || note.find(" 6.") != note.npos));
  CHECK(named(identify(truth, {swing(truth, 1e-5)}, {}, motion_options())).empty());
}

TEST_CASE("motion fit: a window that blows up holds up no other", "[identify]") {
  const Model truth = pendulum_with_friction(0.12, 0.05);
  Recording data = swing(truth, 0.0);
  // A torque that no step of the integrator survives, whatever the parameters are.
  data.tau(data.rows() / 2, 1) = 1e160;
  const Model model = pendulum_with_friction(0.05, 0.02);
  const SensorNoise noise = sensor_noise({data}, {false, false});
  const std::vector<MotionStretch> whole = motion_stretches(data, noise, {false, false});
  std::vector<MotionWindow> windows = cut_windows(whole, 0.4);
  set_measured_states(whole, 0.1, windows);
  FitChoice choice;
  choice.effects = std::vector<std::string>{};
  const FitLayout layout = make_layout(model, choice, {0});
  VecX<double> shape(static_cast<long>(layout.shape.size()));
  for (long s = 0; s < shape.size(); ++s)
    shape[s] = layout.shape[static_cast<std::size_t>(s)].prior;
  const MotionProblem problem{model, layout,         whole,
                              {0},   noise.position, layout.prior().cwiseAbs().cwiseMax(0.1)};
  MotionFitter fitter(problem, {}, layout.prior(), shape);
  fitter.fit(windows, 1e-5);
  const MotionFit& fit = fitter.now();
  CHECK_FALSE(fit.converged);
  CHECK_THAT(fit.termination, ContainsSubstring("1 of " + std::to_string(windows.size())));
  CHECK(std::isfinite(fit.objective));
  for (std::size_t c = 0; c < layout.linear.size(); ++c)
    if (layout.linear[c].name == "elbow.coulomb_friction.coulomb")
      CHECK(fit.x[static_cast<long>(c)] == Approx(0.12).epsilon(0.05));
}

TEST_CASE("motion fit: a joint without a drive has the torque that is known of it, or none",
          "[identify]") {
  Recording data = swing(pendulum_with_friction(0.12, 0.05), 0.0);
  data.tau.col(1).setConstant(0.3);  // a ball pulls
  data.tau(data.rows() / 2, 1) = std::nan("");
  const SensorNoise noise = sensor_noise({data}, {false, true});
  long none = 0, pulled = 0;
  for (const MotionStretch& s : motion_stretches(data, noise, {false, true}))
    for (long k = 0; k < s.u.rows(); ++k) (s.u(k, 1) == 0.3 ? pulled : none) += 1;
  CHECK(none == 1);
  CHECK(pulled == data.rows() - 1);
  CHECK(motion_stretches(data, noise, {false, true}).size() == 1);
  CHECK(motion_stretches(data, noise, {false, false}).size() ==
        2);  // the row without a torque ends one
}

TEST_CASE("window errors: those whose simulation blows up leave the errors of the others",
          "[identify]") {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  WindowErrors errors;
  errors.sum.resize(3, 2);
  errors.sum << 9.0, 32.0, kNaN, 5.0, 27.0, 0.0;  // both joints of the second are left out
  errors.count.resize(3, 2);
  errors.count << 1.0, 2.0, 100.0, 100.0, 3.0, 6.0;
  CHECK(errors.blown_up() == 1);
  CHECK(errors.rmse() == VecX<double>{{3.0, 2.0}});
  errors.sum.setConstant(kNaN);
  CHECK(errors.blown_up() == 3);
  CHECK(errors.rmse().array().isNaN().all());  // no error, not one of 0
}

TEST_CASE("motion fit: held-out windows that blow up are told, and the errors are of the others",
          "[identify]") {
  const Model truth = pendulum_with_friction(0.12, 0.05);
  const Recording train = swing(truth, 0.0);
  Recording test = swing(truth, 0.0, /*seed=*/5);
  const SensorNoise noise = sensor_noise({test}, {false, false});
  const std::string windows =
      std::to_string(cut_windows(motion_stretches(test, noise, {false, false}), 0.4).size());
  // No step of the integrator survives it.
  const auto burst = [&](long from, long rows) {
    test.tau.col(1).segment(from, rows).setConstant(1e30);
    return identify(truth, {train}, {test}, motion_options());
  };
  const auto told = [](const IdentifyResult& result) {
    const auto it = std::ranges::find_if(
        result.notes, [](const std::string& n) { return n.find("blows up") != n.npos; });
    return it == result.notes.end() ? std::string() : *it;
  };
  SECTION("none") { CHECK(told(burst(0, 0)).empty()); }
  SECTION("one") {
    // More rows than are blanked as a logger's fault, and within a window.
    const IdentifyResult result = burst(test.rows() / 2 + 20, 30);
    CHECK(told(result) == "the simulation of 1 of " + windows +
                              " held-out windows blows up; the errors are of the others");
    for (const JointError& e : result.errors) {
      CAPTURE(e.joint);
      // [rad], as of the data of the fit: both are exact, and the model starts at the truth.
      for (const double error : {e.train, e.test, e.nominal_test, e.test_all}) CHECK(error < 1e-4);
      CHECK(std::isfinite(e.test_raw));
    }
  }
  SECTION("all of them") {
    const IdentifyResult result = burst(0, test.rows());
    CHECK_THAT(told(result), ContainsSubstring(windows + " of " + windows) &&
                                 ContainsSubstring("the others, and there is none"));
    for (const JointError& e : result.errors) CHECK(std::isnan(e.test));  // not 0
  }
}

TEST_CASE("motion fit: recordings are whole, however they are streamed, and brief ones count",
          "[identify]") {
  const Model truth = pendulum_with_friction(0.12, 0.05);
  const Recording data = swing(truth, 1e-4);
  // As a source of blocks gives it: pieces of one run, the last one shorter than any window.
  class Blocks : public RecordingSource {
   public:
    Blocks(const Model& model, const Recording& r)
        : whole_(recordings_in_memory(model, {r})), recording_(whole_->sample()[0]) {}
    void for_each(const std::function<bool(const Recording&)>& use) const override {
      const long rows = recording_.rows(), size = rows / 3 + 1 - 20;
      for (long from = 0; from < rows; from += size) {
        Recording block = recording_;
        const long m = std::min(size, rows - from);
        block.time = VecX<double>(recording_.time.segment(from, m));
        for (auto member :
             {&Recording::q, &Recording::qd, &Recording::qdd, &Recording::qcmd, &Recording::tau})
          if ((recording_.*member).size() > 0)
            block.*member = RowMatX<double>((recording_.*member).middleRows(from, m));
        if (!use(block)) return;
      }
    }
    std::vector<Recording> sample() const override { return whole_->sample(); }
    std::vector<int> runs() const override { return whole_->runs(); }
    std::vector<RunDescription> describe_runs() const override { return whole_->describe_runs(); }
    bool holds_payload() const override { return false; }
    const ReadReport& report() const override { return whole_->report(); }
    const std::vector<ChannelWarning>& warnings() const override { return whole_->warnings(); }

   private:
    std::unique_ptr<RecordingSource> whole_;
    Recording recording_;
  };
  const Model start = pendulum_with_friction(0.05, 0.02);
  const IdentifyResult whole = identify(start, {data}, {}, motion_options());
  const IdentifyResult streamed = identify(start, Blocks(start, data), nullptr, motion_options());
  for (std::size_t k = 0; k < whole.parameters.size(); ++k)
    CHECK(streamed.parameters[k].value == whole.parameters[k].value);

  // Sixty rows are a window like any other; two say nothing.
  const auto first = [&](long rows) {
    Recording brief = data;
    brief.source = "brief";
    brief.time = VecX<double>(data.time.head(rows));
    for (auto member :
         {&Recording::q, &Recording::qd, &Recording::qdd, &Recording::qcmd, &Recording::tau})
      if ((brief.*member).size() > 0) brief.*member = RowMatX<double>((data.*member).topRows(rows));
    return brief;
  };
  const auto left_out = [](const IdentifyResult& r) {
    return std::ranges::any_of(r.notes,
                               [](const std::string& n) { return n.find("left out: brief") == 0; });
  };
  CHECK_FALSE(left_out(identify(start, {data, first(60)}, {}, motion_options())));
  CHECK(left_out(identify(start, {data, first(2)}, {}, motion_options())));
  CHECK_THROWS_AS(identify(start, {first(2)}, {}, motion_options()), DataError);
}

}  // namespace motion_fit_test
