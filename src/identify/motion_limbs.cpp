#include <algorithm>
#include <chrono>
#include <cmath>

#include <diffnea/core/parallel.hpp>

#include "core/append.hpp"
#include "identify/drives.hpp"
#include "identify/limb_robots.hpp"
#include "identify/passes.hpp"

namespace diffnea {
namespace {

/// "hip to calf"
std::string name_of(const LimbRobot& limb) {
  const std::vector<std::string> joints = joint_names(limb.model());
  return joints.front() + (joints.size() > 1 ? " to " + joints.back() : "");
}

Posterior side_by_side(const Posterior& a, const Posterior& b) {
  const std::size_t n = a.names.size(), m = b.names.size();
  Posterior out = a;
  append(b.names, out.names);
  append(b.mean, out.mean);
  out.information.assign((n + m) * (n + m), 0.0);
  for (std::size_t i = 0; i < n + m; ++i)
    for (std::size_t j = 0; j < n + m; ++j) {
      if (i < n && j < n) out.information[i * (n + m) + j] = a.information[i * n + j];
      if (i >= n && j >= n) out.information[i * (n + m) + j] = b.information[(i - n) * m + j - n];
    }
  return out;
}

/// Notes of all limbs once; those of one with its name, unless they name a joint of it.
void add_notes(const std::vector<LimbRobot>& limbs, const std::vector<IdentifyResult>& of,
               std::vector<std::string>& notes) {
  const auto said_by_all = [&](const std::string& note) {
    return std::ranges::all_of(of, [&](const IdentifyResult& r) {
      return std::ranges::find(r.notes, note) != r.notes.end();
    });
  };
  for (std::size_t k = 0; k < limbs.size(); ++k)
    for (std::string note : of[k].notes) {
      const bool all = said_by_all(note);
      if (all && k > 0) continue;
      const bool names_it = std::ranges::any_of(
          joint_names(limbs[k].model()),
          [&](const std::string& joint) { return note.find(joint) != note.npos; });
      if (!all && !names_it) {
        const std::size_t at = note.starts_with(kWarning) ? std::string(kWarning).size() : 0;
        note.insert(at, name_of(limbs[k]) + ": ");
      }
      notes.push_back(std::move(note));
    }
}

FitSummary summary_of(const std::vector<LimbRobot>& limbs, const std::vector<IdentifyResult>& of) {
  FitSummary out = of.front().summary;
  for (std::size_t k = 1; k < of.size(); ++k) {
    const FitSummary& s = of[k].summary;
    // The first that did not converge tells why.
    if (out.converged && !s.converged) out.termination = name_of(limbs[k]) + ": " + s.termination;
    out.converged = out.converged && s.converged;
    out.interrupted = out.interrupted || s.interrupted;
    out.iterations = std::max(out.iterations, s.iterations);
    out.fitted_rows += s.fitted_rows;
    out.horizon = std::min(out.horizon, s.horizon);
    out.test_horizon = std::min(out.test_horizon, s.test_horizon);
  }
  return out;
}

/// Fits of all limbs as one of the robot.
IdentifyResult joined(const Model& model, const std::vector<LimbRobot>& limbs,
                      std::vector<IdentifyResult> of) {
  IdentifyResult out;
  out.model = model;
  out.plan = of.front().plan;
  out.plan.q_noise.clear();
  out.plan.tau_noise.clear();
  out.data_report = of.front().data_report;
  out.physically_consistent = true;
  std::optional<Posterior> posterior;
  for (std::size_t k = 0; k < limbs.size(); ++k) {
    IdentifyResult& r = of[k];
    limbs[k].put(r.model, out.model);
    posterior = posterior ? side_by_side(*posterior, *r.model.posterior) : *r.model.posterior;
    append(r.parameters, out.parameters);
    append(r.errors, out.errors);
    append(r.horizons, out.horizons);
    append(r.boundary, out.boundary);
    append(r.train_series, out.train_series);
    append(r.test_series, out.test_series);
    append(r.plan.q_noise, out.plan.q_noise);
    append(r.plan.tau_noise, out.plan.tau_noise);
    out.plan.dt = std::min(out.plan.dt, r.plan.dt);
    out.physically_consistent = out.physically_consistent && r.physically_consistent;
  }
  out.model.posterior = std::move(posterior);
  std::ranges::stable_sort(out.horizons, {}, &HorizonError::horizon);
  add_notes(limbs, of, out.notes);
  out.summary = summary_of(limbs, of);
  return out;
}

}  // namespace

IdentifyResult identify_by_motion(const Model& model, const RecordingSource& train,
                                  const RecordingSource* test, const IdentifyOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  FitChoice choice = options.choice;
  choice.simulated = true;
  std::vector<std::string> said_by_limbs;
  const FitLayout layout = layout_for(model, train, test, choice, said_by_limbs);
  const MotionData data = motion_data(model, train, test, commanded_joints(layout), said_by_limbs);
  const std::vector<LimbRobot> limbs = limb_robots(model, layout, data);
  if (limbs.size() == 1) return fit_motion(model, train, test, options);

  const std::size_t threads = static_cast<std::size_t>(std::max(options.motion.threads, 1));
  IdentifyOptions of_limb = options;
  of_limb.motion.threads = static_cast<int>(std::max<std::size_t>(threads / limbs.size(), 1));
  of_limb.progress = shared_progress(options.progress);
  std::vector<IdentifyResult> results(limbs.size());
  parallel_for(limbs.size(), threads, [&](std::size_t k, std::size_t) {
    IdentifyOptions own = of_limb;
    own.choice = limbs[k].choice(layout, options.choice);
    const auto fitted = limbs[k].recordings(train);
    const auto held_out = test ? limbs[k].recordings(*test) : nullptr;
    results[k] = fit_motion(limbs[k].model(), *fitted, held_out.get(), own);
  });
  IdentifyResult out = joined(model, limbs, std::move(results));
  out.summary.seconds_fitting = out.summary.seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return out;
}

}  // namespace diffnea
