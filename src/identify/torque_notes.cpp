#include "identify/torque_notes.hpp"

#include <algorithm>
#include <cmath>

#include "identify/torque_scale.hpp"

namespace diffnea {
namespace {

/// Force that a base lacks over the robot's weight from which it cannot fly: legs that swing move
/// less of it, and a foot on the ground bears more.
constexpr double kContact = 0.3;

void note_calibration(const FitParameter& mass, const FitLayout& layout, const Gains& gains,
                      const LinearFit& fit, std::vector<std::string>& notes) {
  std::string list;
  for (std::size_t c = 0; c < layout.linear.size(); ++c)
    if (gains.owns(static_cast<int>(c)) && fit.identifiable[c])
      list += (list.empty() ? "" : ", ") + layout.effects[layout.linear[c].effect].where + " " +
              format_number(fit.x[c]) + " ± " + format_number(fit.std[c]);
  if (!list.empty())
    notes.push_back(
        "the known payload (" + mass.name + " = " + format_number(mass.prior) +
        " kg) calibrates the torque: recorded over true torque is 1 + gain_error, " + list +
        ". The links' parameters are true ones; friction and offsets are of the recorded torque");
}

}  // namespace

void note_rest(const Model& model, const TorqueRegression& rows, std::vector<std::string>& notes) {
  const std::vector<std::string> names = joint_names(model);
  std::string list;
  for (int j = 0; j < static_cast<int>(names.size()); ++j) {
    const double rest = static_cast<double>(rows.rows_at_rest(j));
    const double all = rest + static_cast<double>(rows.factors()[j].factor.rows());
    if (rest > 0.05 * all)
      list +=
          (list.empty() ? "" : ", ") + names[j] + " " + format_number(100.0 * rest / all) + " %";
  }
  if (!list.empty())
    notes.push_back(
        "torque samples at which a joint rests, and those that the filter mixes with its rests, "
        "are "
        "left out, since dry friction at rest can have any size: " +
        list);
}

void note_torque_scale(const Model& model, const FitLayout& layout, const TorqueRegression& rows,
                       std::vector<std::string>& notes) {
  const std::optional<TorqueScale> scale = common_torque_scale(layout, rows.factors());
  if (!scale) return;
  std::string list;
  for (const auto& [row, factor] : scale->of_joint)
    list += (list.empty() ? "" : ", ") + row_name(model, row) + " " + format_number(factor);
  notes.push_back(
      std::string(kWarning) + "the torques are " + format_number(scale->factor) +
      " times what the model's links need before the fit, alike at several joints (" + list +
      "): a current, another unit, gear ratio or torque constant of the columns, masses of the "
      "model "
      "that are wrong by one factor, or a body in the hand that it does not have. Torques "
      "alone cannot tell these apart: what is fitted predicts the recorded torques, and "
      "its masses are so many times those of the model");
}

void note_contact(const Model& model, const FitLayout& layout, const TorqueRegression& rows,
                  const VecX<double>& x, std::vector<std::string>& notes) {
  if (layout.base_rows == 0) return;
  double squares = 0.0, mass = 0.0;
  for (int row = layout.num_rows() - 3; row < layout.num_rows(); ++row) {
    const JointFactor& f = rows.factors()[static_cast<std::size_t>(row)];
    squares += f.factor.rows() > 0 ? std::pow(f.rmse(x), 2) : 0.0;
  }
  for (const int b : layout.bodies())
    if (layout.linear[static_cast<std::size_t>(b)].dof >= 0) mass += x[b];
  const Tree<double> tree = make_tree(model);
  const double left = std::sqrt(squares),
               weight = mass * std::sqrt(dot(tree.gravity, tree.gravity));
  if (!(left > kContact * weight) || weight == 0.0) return;
  notes.push_back(
      std::string(kWarning) + "the base lacks a force of " + format_number(left) + " N (rms), " +
      format_number(100.0 * left / weight) +
      " % of the robot's weight: something holds or touches it. Forces of contacts are "
      "not modelled; give flights alone, record the wrench (base_tx … base_fz), or read "
      "a base that stood still as fixed (--fix-base)");
}

void note_band(const PreprocessPlan& fitted, const PreprocessPlan& held_out,
               std::vector<std::string>& notes) {
  constexpr double kNarrower = 0.8;  // the rates of two clocks are not the same number
  const double fit = fitted.decimator.pass_hz, test = held_out.decimator.pass_hz;
  if (test < kNarrower * fit)
    notes.push_back(
        "held-out data are sampled at " + format_number(1.0 / held_out.dt) +
        " Hz, too slowly for the band of the fit: their errors are of what lies below " +
        format_number(test) + " Hz, those of the fitted data below " + format_number(fit) + " Hz");
}

void note_payloads(const FitLayout& layout, const Gains& gains, const LinearFit& fit,
                   std::vector<std::string>& notes) {
  for (std::size_t c = 0; c < layout.linear.size(); ++c) {
    const FitParameter& p = layout.linear[c];
    if (p.effect < 0 || p.theta != 0) continue;
    if (!p.fixed && fit.identifiable[c])
      notes.push_back(
          p.name + " = " + format_number(fit.x[c]) + " ± " + format_number(fit.std[c]) +
          " kg hangs on the torque constants: torque is K times current, so that dm/m = dK/K, "
          "and K that is 5 % "
          "too large makes " +
          format_number(0.05 * fit.x[c]) +
          " kg of it. The standard error knows of noise, not of K");
    if (p.fixed && p.prior > 0.0 && !layout.effects[p.effect].runs.empty())
      note_calibration(p, layout, gains, fit, notes);
  }
}

void note_consistency(const FitLayout& layout, const LinearFit& fit, IdentifyResult& result) {
  const std::vector<int> bodies = layout.bodies();
  for (const int b : fit.solver.active_bodies) {
    const std::string& name = layout.linear[bodies[b]].name;
    result.boundary.push_back(name.substr(0, name.rfind('.')));
  }
  result.consistency_cost = fit.solver.consistency_cost;
  for (const std::string& link : result.boundary)
    result.notes.push_back("the data press " + link +
                           " to the boundary of what a body can be (a flat or massless part)");
  if (result.consistency_cost > 10.0)
    result.notes.push_back(
        "physical consistency costs " + format_number(result.consistency_cost) +
        " in chi^2/2: the data ask for an impossible body, a sign of an effect the model lacks");
}

std::vector<TorqueConstant> calibrated_constants(const Model& model, const FitLayout& layout,
                                                 const Gains& gains, const LinearFit& fit,
                                                 const RecordingSource& train) {
  std::vector<TorqueConstant> out;
  std::vector<std::pair<std::string, double>> assumed;
  for (const Recording& r : train.sample())
    if (assumed.empty()) assumed = r.info.torque_constant;
  const std::vector<int> moving = moving_links(model);
  const std::vector<std::string> joints = joint_names(model);
  for (std::size_t c = 0; c < layout.linear.size(); ++c) {
    const FitParameter& p = layout.linear[c];
    if (!gains.owns(static_cast<int>(c)) || p.fixed) continue;
    for (const int j : layout.effects[p.effect].joints) {
      const auto known =
          std::ranges::find(assumed, joints[j], &std::pair<std::string, double>::first);
      if (known == assumed.end()) continue;
      const double scale = 1.0 + fit.x[c];
      const bool slides = model.links[moving[j]].type == ModelJoint::kPrismatic;
      out.push_back({joints[j], slides ? "N/A" : "N*m/A", known->second, known->second / scale,
                     known->second * fit.std[c] / (scale * scale)});
    }
  }
  return out;
}

}  // namespace diffnea
