#include "identify/ball_identify.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/posterior.hpp>

#include "core/constants.hpp"
#include "core/decompositions.hpp"
#include "identify/ball_flags.hpp"
#include "identify/ball_path.hpp"
#include "identify/bounce_guess.hpp"
#include "identify/fix_pattern.hpp"
#include "identify/passes.hpp"
#include "identify/whole_runs.hpp"

namespace diffnea {
namespace {

/// A length or place of the string that is known worse than this is not known [m].
constexpr double kKnown = 0.02;
/// Share of a parameter's own influence that the others must leave.
constexpr double kVisible = 1e-3;
/// Rows that the string does not let the ball reach: in standard deviations of the camera, and in
/// lengths of the string.
constexpr double kTooFar = 6.0, kLeastTooFar = 0.01;
/// Share of the rows beyond the string's reach from where the length is at fault.
constexpr double kMostTooFar = 0.1;
/// What a fit may leave over the camera's noise.
constexpr double kMostLeft = 1.1;
/// Of fits and rows left out.
constexpr int kMostRounds = 4;

bool is_ball_effect(const std::string& entry) {
  return acts_on_ball(find_effect(entry.substr(0, entry.find('@'))));
}

bool names_ball(const std::string& pattern) {
  const std::string first = pattern.substr(0, pattern.find('.'));
  return first == "string" || first == "ball" || first == "camera";
}

const char* only_place(const EffectInfo& effect) {
  return effect.place == Place::kString   ? "string"
         : effect.place == Place::kCamera ? "camera"
                                          : "ball";
}

/// Tells whether an effect of it needs the ball's spin.
bool fits_lift(const BallLayout& layout) {
  return std::ranges::any_of(layout.effects,
                             [](const BoundEffect& e) { return e.info().has(Trait::kNeedsSpin); });
}

/// Tells whether the parameter is of a plane that the ball bounces off.
bool is_of_bounce(const BallLayout& layout, const BallParameter& p) {
  return p.effect >= 0 &&
         layout.effects[static_cast<std::size_t>(p.effect)].info().port == Port::kBallImpact;
}

/// How much of each free parameter's influence on the path the others leave, from R.
VecX<double> visible_shares(const MatX<double>& R) {
  VecX<double> out(R.cols());
  for (Eigen::Index k = 0; k < R.cols(); ++k) {
    MatX<double> others(R.rows(), R.cols() - 1);
    others << R.leftCols(k), R.rightCols(R.cols() - 1 - k);
    const double norm = R.col(k).norm();
    const VecX<double> left =
        others.cols() == 0
            ? VecX<double>(R.col(k))
            : VecX<double>(R.col(k) - others * others.colPivHouseholderQr().solve(R.col(k)));
    out[k] = norm > 0.0 ? left.norm() / norm : 0.0;
  }
  return out;
}

double distance(const BallSeries::Point& a, const BallSeries::Point& b) {
  return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

/// Rows further from the anchor than the string lets them be (one that gives: than it is then).
/// @return how many
long flag_too_far(const BallSeries& series, std::vector<BallFlag>& flagged) {
  const double limit = std::max(kTooFar * series.sigma, kLeastTooFar * series.length);
  long out = 0;
  for (std::size_t k = 0; k < series.time.size(); ++k) {
    const double reach = std::max(series.length, distance(series.extended[k], series.anchor[k])),
                 beyond = distance(series.measured[k], series.anchor[k]) - reach;
    if (!(beyond > limit)) continue;
    ++out;
    flagged.push_back({series.run[k], series.time[k], "ball",
                       "is " + format_number(1e3 * beyond) +
                           " mm further from the anchor than the string is long (" +
                           format_number(series.length) + " m)"});
  }
  return out;
}

}  // namespace

DividedChoice divide_choice(const Model& model, const FitChoice& choice) {
  DividedChoice out;
  out.arm = choice;
  out.arm.fix.clear();
  out.fit_string = std::ranges::find(choice.fit, "string") != choice.fit.end();
  out.fit_effects = std::ranges::find(choice.fit, "effects") != choice.fit.end();
  for (const EffectSpec& e : model.effects)
    if (is_ball_effect(e.effect)) out.ball_effects.push_back(e);
  const auto add = [&](const std::string& entry) {
    const std::size_t at = entry.find('@');
    const std::string name = entry.substr(0, at);
    const EffectSpec spec{
        name, at == std::string::npos ? only_place(find_effect(name)) : entry.substr(at + 1), {}};
    const bool present = std::ranges::any_of(out.ball_effects, [&](const EffectSpec& e) {
      return e.effect == spec.effect && e.where == spec.where;
    });
    if (!present) out.ball_effects.push_back(spec);
  };
  if (!choice.effects) {
    if (model.ball && out.fit_effects) add(model.ball->string ? "linear_drag" : "quadratic_drag");
  } else {
    std::vector<std::string> rest;
    for (const std::string& entry : *choice.effects)
      if (!is_ball_effect(entry)) {
        rest.push_back(entry);
      } else {
        add(entry);
        out.asked.push_back(entry);
      }
    // Whoever names effects of the ball alone says nothing of the arm's.
    if (rest.empty() && !choice.effects->empty())
      out.arm.effects.reset();
    else
      out.arm.effects = rest;
  }
  for (const std::string& entry : choice.fix) {
    const bool ball = model.ball && names_ball(entry);
    (ball ? out.ball_fix : out.arm.fix).push_back(entry);
    if (ball) out.asked.push_back(entry);
  }
  return out;
}

void share_fix(const Model& model, DividedChoice& choice) {
  // Effects of the model may be ones that identify cannot fit, which do not matter here.
  Model bare = model;
  bare.effects.clear();
  FitChoice free = choice.arm;
  free.fix.clear();
  const FitLayout layout = make_layout(bare, free, {0});
  std::vector<std::string> arm, ball;
  for (const auto* list : {&layout.linear, &layout.shape})
    for (const FitParameter& p : *list) arm.push_back(p.name);
  for (const EffectSpec& e : model.effects)
    if (!is_ball_effect(e.effect))
      for (const ParameterInfo& p : bind(e, model).parameter_info)
        arm.push_back(e.where + "." + e.effect + "." + p.name);
  for (const BallParameter& p :
       make_ball_layout(model, choice.ball_effects, choice.fit_string).parameters)
    ball.push_back(p.name);
  std::vector<std::string> rest;
  for (const std::string& entry : choice.arm.fix) {
    const std::string pattern = split_value(entry).first;
    const auto any = [&](const std::vector<std::string>& names) {
      return std::ranges::any_of(names, [&](const auto& name) { return matches(pattern, name); });
    };
    const bool of_arm = any(arm), of_ball = any(ball);
    if (of_arm) rest.push_back(entry);
    if (of_ball) choice.ball_fix.push_back(entry);
    if (of_arm || of_ball) continue;
    std::string names;
    for (const auto* list : {&ball, &arm})
      for (const std::string& name : *list) names += (names.empty() ? "" : ", ") + name;
    throw ModelError("fix: no parameter matches '" + pattern + "'; parameters: " + names);
  }
  choice.arm.fix = rest;
}

BallLayout ball_layout_for(const Model& model, const DividedChoice& choice) {
  BallLayout layout = make_ball_layout(model, choice.ball_effects, choice.fit_string);
  for (BallParameter& p : layout.parameters)
    if (p.effect >= 0 && !choice.fit_effects) p.fixed = true;
  for (const std::string& entry : choice.ball_fix) {
    const auto [pattern, value] = split_value(entry);
    bool found = false;
    std::string names;
    for (BallParameter& p : layout.parameters) {
      names += (names.empty() ? "" : ", ") + p.name;
      if (!matches(pattern, p.name)) continue;
      p.fixed = found = true;
      if (!value) continue;
      require_possible(entry, p.name, *value, p.sign);
      p.value = *value;
    }
    if (!found)
      throw ModelError("fix: no parameter of the ball matches '" + pattern +
                       "'; parameters: " + names);
  }
  return layout;
}

std::vector<Recording> recordings_with_ball(const RecordingSource& source) {
  std::vector<Recording> out;
  for_each_run(
      source, [](const Recording& r) { return r.ball.size() > 0; },
      [&](const Recording& r) { out.push_back(r); });
  return out;
}

bool has_spin(const BallData& data) {
  return std::ranges::any_of(data.windows,
                             [](const BallWindow& w) { return dot(w.spin, w.spin) > 0.0; });
}
void require_spin(const BallData& data) {
  if (!has_spin(data))
    throw DataError(data.source +
                    ": magnus needs the ball's spin; expected columns spin_x, spin_y, spin_z "
                    "[rad/s] in the world's frame");
}

void identify_ball(const std::vector<Recording>& train, const std::vector<Recording>& test,
                   const DividedChoice& choice, const IdentifyOptions& options,
                   IdentifyResult& result) {
  Model model = result.model;
  BallFitOptions fit_options = options.ball;
  const BallLayout first = ball_layout_for(model, choice);
  Model asked = apply_ball(model, first, first.values());
  BallData data = make_ball_data(asked, train, fit_options, options.preprocess);
  if (fits_lift(first)) require_spin(data);
  const bool length_free = model.ball->string && choice.fit_string && !first.parameters[0].fixed;
  FittedBall before = fit_states({asked, first, first.values(), data}, data, fit_options);
  BallLayout layout = first;
  if (length_free) {
    Vec3<double> p_LS = asked.ball->string->p_LS;
    double length = asked.ball->string->length;
    guess_string(data, p_LS, length, asked.gravity);
    const double guess[4] = {length, p_LS.x, p_LS.y, p_LS.z};
    for (int k = 0; k < 4; ++k)
      if (!layout.parameters[k].fixed) layout.parameters[k].value = guess[k];
  }
  if (std::ranges::any_of(first.parameters,
                          [&](const BallParameter& p) { return is_of_bounce(first, p); }))
    if (const auto guess = guess_bounce(data, *model.ball, asked.gravity, fit_options.longest_gap))
      for (BallParameter& p : layout.parameters)
        if (!p.fixed && is_of_bounce(layout, p))
          p.value = p.index == 0   ? guess->restitution
                    : p.index == 1 ? guess->friction
                                   : guess->height;
  const auto fit_once = [&] {
    if (fit_options.loss == BallLoss::kConstrained)
      return fit_ball_constrained(asked, layout, data, fit_options);
    return fit_ball(asked, layout, data, fit_options, [&](int iteration, double sigma) {
      return !options.progress || options.progress({"fitting the ball", iteration, 0, sigma});
    });
  };
  BallFit fit = fit_once();
  double lift = 0.0;  // that the spins agree on
  // Rows first: one that is far off makes its flight contradict any spin.
  const auto clean = [&](const FittedBall& ball, BallData& rows, int round) {
    return round % 2 == 1 && fits_lift(layout)
               ? drop_false_spins(ball, rows, fit.sigma, fit_options, lift)
               : drop_far_rows(ball, rows, fit_options.flight);
  };
  for (int round = 0; round < kMostRounds && !fit.interrupted; ++round) {
    if (!clean({asked, layout, fit.p, data}, data, round)) continue;
    for (std::size_t k = 0; k < layout.parameters.size(); ++k)
      layout.parameters[k].value = fit.p[static_cast<Eigen::Index>(k)];
    fit = fit_once();
  }
  FittedBall after{asked, layout, fit.p, data};
  before = fit_states(before, data, fit_options);
  if (fit_options.loss == BallLoss::kConstrained) after = fit_states(after, data, fit_options);
  result.model = apply_ball(asked, layout, fit.p);

  const BallLinearisation at =
      linearise_ball(asked, layout, fit.p, after.data, fit.sigma, fit_options);
  const VecX<double> visible = visible_shares(at.R);
  Eigen::Index free = 0;
  std::vector<Eigen::Index> known;  // columns of the linearisation
  Posterior posterior;
  for (std::size_t k = 0; k < layout.parameters.size(); ++k) {
    const BallParameter& p = layout.parameters[k];
    const auto i = static_cast<Eigen::Index>(k);
    ParameterEstimate e{p.name, p.unit,  fit.p[i], 0.0, first.parameters[k].value,
                        false,  p.fixed, false};
    if (!p.fixed) {
      e.std = std::sqrt(fit.covariance(i, i));
      e.identifiable = visible[free++] > kVisible && (p.effect >= 0 || e.std < kKnown);
      e.at_bound = (p.sign == Sign::kNonNegative && fit.p[i] == 0.0) || fit.p[i] >= p.most;
      if (!e.identifiable) e.std = kNaN;
      if (e.identifiable) {
        known.push_back(free - 1);
        posterior.names.push_back(p.name);
        posterior.mean.push_back(fit.p[i]);
      }
      if (p.effect < 0 && p.index == 0 && e.identifiable)
        result.model.ball->string->length_std = e.std;
      if (!e.identifiable && p.effect < 0)
        result.notes.push_back(
            std::string(kWarning) + p.name +
            ": this recording does not tell it; the hand must turn against the string while the "
            "ball hangs on it (a longer recording, or larger turns of the last joints)");
    }
    result.parameters.push_back(e);
  }
  const MatX<double> H = (at.R.transpose() * at.R)(known, known);  // what is not known is held
  posterior.information.assign(H.data(), H.data() + H.size());
  const std::optional<Posterior> before_ball = result.model.posterior;
  if (before_ball || !known.empty())
    result.model.posterior = joined(before_ball ? &*before_ball : nullptr, &posterior);

  JointError error;
  error.joint = "ball";
  error.unit = "m";
  error.torque_rms = path_spread(data);
  error.train = path_rms(after, fit_options.flight);
  error.nominal_train = path_rms(before, fit_options.flight);
  error.test = error.nominal_test = error.test_all = error.test_raw = kNaN;
  if (!test.empty()) {
    BallData held_out = make_ball_data(asked, test, fit_options, options.preprocess);
    if (fits_lift(first)) require_spin(held_out);
    after = fit_states(after, held_out, fit_options);
    error.test_raw = path_rms(after, fit_options.flight);
    for (int round = 0; round < kMostRounds; ++round) {
      held_out = after.data;
      if (!clean(after, held_out, round)) continue;
      after = fit_states(after, held_out, fit_options);
    }
    before = fit_states(before, held_out, fit_options);
    error.torque_rms = path_spread(held_out);
    error.test = error.test_all = path_rms(after, fit_options.flight);
    error.nominal_test = path_rms(before, fit_options.flight);
  }
  result.errors.push_back(error);
  BallSeries series = make_ball_series(before, after, fit_options.flight);
  series.held_out = !test.empty();
  const double camera = camera_noise(data, fit_options.longest_gap);
  series.sigma = std::isfinite(camera) ? camera : fit.sigma;
  const long too_far = series.has_string ? flag_too_far(series, series.flagged) : 0;
  result.notes.push_back(
      "ball: " + std::to_string(data.windows.size()) + " windows of at most " +
      format_number(fit_options.window) +
      " s, each from an estimated state of its own; what is "
      "left is " +
      format_number(1e3 * fit.sigma) + " mm of a position along one axis" +
      (model.ball->string ? "; the joints' measured motion drives the string" : ""));
  if (data.touching > 0)
    result.notes.push_back("ball: " + std::to_string(data.touching) +
                           " rows are left out, at which it touches the cup or did so within half "
                           "a second");
  if (static_cast<double>(too_far) > kMostTooFar * static_cast<double>(series.rows()))
    result.notes.push_back(
        std::string(kWarning) + "ball: in " + std::to_string(too_far) + " of " +
        std::to_string(series.rows()) + " rows it is further from the anchor than the string of " +
        format_number(series.length) + " m is long" +
        (layout.parameters[0].fixed ? "; string.length is held: let the fit move it, or correct it"
                                    : "; look at where the string is tied"));
  if (fit.sigma > kMostLeft * camera)
    result.notes.push_back(
        std::string(kWarning) + "ball: the fit leaves " + format_number(1e3 * fit.sigma) +
        " mm along one axis where the camera's noise is " + format_number(1e3 * camera) +
        " mm: its path is not the model's, which standard errors do not count; diagnose may tell "
        "what "
        "is missing");
  if (!series.flagged.empty())
    result.notes.push_back(std::string(kWarning) +
                           "ball: " + std::to_string(series.flagged.size()) +
                           " rows or flights cannot be true and are flagged, e.g. at " +
                           format_number(series.flagged.front().time) + " s: the " +
                           series.flagged.front().channel + ": " + series.flagged.front().reason);
  result.ball = std::move(series);
  FitSummary& s = result.summary;
  s.fitted_rows += fit.samples / 3;
  s.iterations = std::max(s.iterations, fit.iterations);
  s.interrupted = s.interrupted || fit.interrupted;
  const bool alone = s.termination.empty();
  s.converged = alone ? fit.converged : s.converged && fit.converged;
  if (alone || !fit.converged) s.termination = "ball: " + fit.termination;
}

}  // namespace diffnea
