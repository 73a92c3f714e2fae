#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <optional>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/identify/ball_fit.hpp>
#include <diffnea/identify/convex_fit.hpp>
#include <diffnea/identify/linear_fit.hpp>
#include <diffnea/identify/posterior.hpp>
#include <diffnea/model/physical.hpp>

#include "core/c_numbers.hpp"
#include "core/decompositions.hpp"
#include "identify/ball_path.hpp"
#include "identify/passes.hpp"

namespace diffnea {
namespace {

/// What a parameter without a scale of its own may well be: so many standard deviations, all others
/// known.
constexpr double kWide = 10.0;

bool of_ball(const std::string& name) {
  return name.starts_with("string.") || name.starts_with("ball.") || name.starts_with("camera.");
}

Posterior part(const Posterior& whole, bool ball) {
  const long n = static_cast<long>(whole.names.size());
  std::vector<long> kept;
  for (long i = 0; i < n; ++i)
    if (of_ball(whole.names[static_cast<std::size_t>(i)]) == ball) kept.push_back(i);
  Posterior out;
  for (const long i : kept) {
    out.names.push_back(whole.names[static_cast<std::size_t>(i)]);
    out.mean.push_back(whole.mean[static_cast<std::size_t>(i)]);
    for (const long j : kept)
      out.information.push_back(whole.information[static_cast<std::size_t>(i * n + j)]);
  }
  return out;
}

/// "elbow.coulomb_friction.coulomb"; where ends at the second dot from the right.
struct EffectName {
  std::string where, effect, parameter;
};
std::optional<EffectName> effect_name(const std::string& name) {
  const std::size_t last = name.rfind('.');
  const std::size_t first =
      last == std::string::npos || last == 0 ? last : name.rfind('.', last - 1);
  if (first == std::string::npos || first == last) return std::nullopt;
  return EffectName{name.substr(0, first), name.substr(first + 1, last - first - 1),
                    name.substr(last + 1)};
}

EffectSpec* find(Model& model, const EffectName& name) {
  const auto it = std::ranges::find_if(model.effects, [&](const EffectSpec& e) {
    return e.effect == name.effect && e.where == name.where;
  });
  return it == model.effects.end() ? nullptr : &*it;
}

double* string_parameter(Model& model, const std::string& name) {
  if (!model.ball || !model.ball->string) return nullptr;
  StringSpec& s = *model.ball->string;
  if (name == "string.length") return &s.length;
  if (name == "string.attachment_x") return &s.p_LS.x;
  if (name == "string.attachment_y") return &s.p_LS.y;
  if (name == "string.attachment_z") return &s.p_LS.z;
  return nullptr;
}

/// @throws ModelError if the parameter cannot have that value
void set_varied(Model& model, const std::string& name, double value) {
  if (double* p = string_parameter(model, name)) {
    if (name == "string.length" && !(value > 0.0))
      throw ModelError("vary: string.length: got " + format_number(value) +
                       " m, expected a positive length");
    *p = value;
    return;
  }
  const EffectName parts = *effect_name(name);
  EffectSpec& spec = *find(model, parts);
  std::ranges::find(spec.parameters, parts.parameter, &EffectParameter::name)->value = value;
  const BoundEffect bound = bind(spec, model);  // throws where a sign is wrong
  for (std::size_t k = 0; k < bound.parameters.size(); ++k)
    if (bound.parameter_info[k].name == parts.parameter && value > bound.parameter_info[k].most)
      throw ModelError("vary: " + name + ": got " + format_number(value) + ", expected at most " +
                       format_number(bound.parameter_info[k].most));
}

/// Effects whose parameters a posterior names; others may be ones that identify cannot fit, and a
/// posterior says nothing of them.
Model with_named_effects(const Model& model, const Posterior& posterior) {
  Model out = model;
  std::erase_if(out.effects, [&](const EffectSpec& e) {
    const std::string prefix = e.where + "." + e.effect + ".";
    return std::ranges::none_of(posterior.names,
                                [&](const std::string& n) { return n.starts_with(prefix); });
  });
  return out;
}

FitLayout arm_layout(const Model& named) {
  FitChoice choice;
  choice.effects = std::vector<std::string>{};
  return make_layout(named, choice, {0});
}

BallLayout ball_layout(const Model& named) {
  std::vector<EffectSpec> effects;
  for (const EffectSpec& e : named.effects)
    if (acts_on_ball(find_effect(e.effect))) effects.push_back(e);
  return named.ball ? make_ball_layout(named, effects) : BallLayout{};
}

/// The Gaussian about a model, and what is possible. Parameters: the arm's linear ones, then the
/// ball's.
class Sampler {
 public:
  explicit Sampler(const Model& model)
      : model_(model),
        named_(with_named_effects(model, *model.posterior)),
        arm_(arm_layout(named_)),
        ball_(ball_layout(named_)) {
    const Posterior& posterior = *model.posterior;
    const long arm = static_cast<long>(arm_.linear.size()),
               p = arm + static_cast<long>(ball_.parameters.size());
    mean_.resize(p);
    mean_ << arm_.prior(), ball_.values();
    std::vector<std::string> names;
    for (const FitParameter& f : arm_.linear) names.push_back(f.name);
    for (const BallParameter& b : ball_.parameters) names.push_back(b.name);
    std::vector<long> at;
    for (const std::string& name : posterior.names) {
      const auto it = std::ranges::find(names, name);
      if (it == names.end())
        throw ModelError((model.source.empty() ? "the model" : model.source) +
                         ": its posterior names '" + name +
                         "', which the model has not; identify it again");
      at.push_back(it - names.begin());
    }
    if (model.ball && model.ball->string && model.ball->string->length_std > 0.0 &&
        std::ranges::none_of(posterior.names, of_ball))
      throw ModelError((model.source.empty() ? "the model" : model.source) +
                       ": its posterior says nothing of the string that was identified (a file of "
                       "an earlier version); identify the ball again");
    set_problem(at, arm, names);
  }

  Model draw(Rng& rng) const {
    VecX<double> z(root_.cols());
    for (long k = 0; k < z.size(); ++k) z[k] = rng.normal();
    VecX<double> x = mean_ + root_ * z;
    if (!possible(x)) {
      ConvexFitProblem problem = problem_;
      problem.d = problem.R * x;
      x = solve_convex_fit(problem).x;
    }
    for (std::size_t k = 0; k < ball_.parameters.size(); ++k) {
      double& value = x[static_cast<long>(arm_.linear.size() + k)];
      value = std::min(value, ball_.parameters[k].most);
    }
    const long arm = static_cast<long>(arm_.linear.size());
    VecX<double> shape(arm_.shape.size());
    for (std::size_t k = 0; k < arm_.shape.size(); ++k)
      shape[static_cast<long>(k)] = arm_.shape[k].prior;
    Model out = apply_fit(model_, arm_, x.head(arm), shape);
    if (model_.ball) out = apply_ball(out, ball_, x.tail(x.size() - arm));
    // In the order of the model's: apply_ball moves what it writes to the end.
    const auto place = [&](const EffectSpec& e) {
      return std::ranges::find_if(model_.effects, [&](const EffectSpec& m) {
        return m.effect == e.effect && m.where == e.where;
      });
    };
    std::ranges::stable_sort(out.effects, {}, place);
    out.posterior.reset();
    return out;
  }

 private:
  /// @param at  of every name of the posterior, its index among the parameters
  void set_problem(const std::vector<long>& at, long arm, const std::vector<std::string>& names) {
    const Posterior& posterior = *model_.posterior;
    const long n = static_cast<long>(at.size()), p = mean_.size();
    const MatX<double> H = Eigen::Map<const MatX<double>>(posterior.information.data(), n, n);
    VecX<double> scales(p);
    for (long k = 0; k < p; ++k)
      scales[k] = k < arm ? arm_.linear[static_cast<std::size_t>(k)].scale
                          : std::numeric_limits<double>::quiet_NaN();
    VecX<double> scale(n);
    for (long i = 0; i < n; ++i) {
      double& s = scales[at[static_cast<std::size_t>(i)]];
      if (std::isnan(s))
        s = std::max(std::abs(mean_[at[static_cast<std::size_t>(i)]]),
                     H(i, i) > 0.0 ? kWide / std::sqrt(H(i, i)) : 1.0);
      scale[i] = s;
    }
    scales = scales.array().isNaN().select(1.0, scales);
    const MatX<double> scaled = scale.asDiagonal() * H * scale.asDiagonal();
    const Eigen::SelfAdjointEigenSolver<MatX<double>> eigen(scaled);
    root_ = MatX<double>::Zero(p, n);
    for (long k = 0; k < n; ++k) {
      if (!(eigen.eigenvalues()[k] >= 1.0)) continue;
      const VecX<double> direction =
          scale.cwiseProduct(eigen.eigenvectors().col(k)) / std::sqrt(eigen.eigenvalues()[k]);
      for (long i = 0; i < n; ++i) root_(at[static_cast<std::size_t>(i)], k) = direction[i];
    }

    MatX<double> metric = MatX<double>::Zero(p, p);
    for (long i = 0; i < n; ++i)
      for (long j = 0; j < n; ++j)
        metric(at[static_cast<std::size_t>(i)], at[static_cast<std::size_t>(j)]) = H(i, j);
    metric.diagonal() += scales.cwiseProduct(scales).cwiseInverse();
    problem_.R = Eigen::LLT<MatX<double>>(metric).matrixU();
    problem_.start.resize(p);
    problem_.start << consistent_start(arm_, scales.head(arm)), mean_.tail(p - arm);
    const auto is_free = [&](long k) { return std::ranges::find(at, k) != at.end(); };
    for (long k = 0; k < p; ++k) {
      const Sign sign = k < arm ? arm_.linear[static_cast<std::size_t>(k)].sign
                                : ball_.parameters[static_cast<std::size_t>(k - arm)].sign;
      if (!is_free(k)) {
        problem_.fixed.push_back(static_cast<int>(k));
        problem_.start[k] = mean_[k];
      } else if (sign != Sign::kFree) {
        problem_.nonnegative.push_back(static_cast<int>(k));
        problem_.start[k] = std::max(problem_.start[k], 1e-3 * scales[k]);
      }
    }
    for (const int b : arm_.bodies()) {
      bool any = false;
      for (int k = 0; k < kThetaSize; ++k) any = any || is_free(b + k);
      if (any) problem_.bodies.push_back(b);
    }
    if (names.empty()) throw ModelError("posterior: names no parameter");
  }

  bool possible(const VecX<double>& x) const {
    for (const int b : problem_.bodies) {
      Theta<double> theta;
      std::copy_n(x.data() + b, kThetaSize, theta.begin());
      if (!(smallest_pseudo_inertia_eigenvalue(theta) > 0.0)) return false;
    }
    return std::ranges::all_of(problem_.nonnegative, [&](int k) { return x[k] >= 0.0; });
  }

  const Model& model_;
  Model named_;
  FitLayout arm_;
  BallLayout ball_;
  VecX<double> mean_;
  MatX<double> root_;         ///< (parameters × directions): times standard normals, the draw
  ConvexFitProblem problem_;  ///< the nearest that is possible, but for its d
};

}  // namespace

Variation parse_variation(const std::string& text) {
  const auto fail = [&] {
    return Error("vary: got '" + text +
                 "', expected PARAMETER=LOW:HIGH, e.g. string.string_mass.mass_ratio=0:0.1");
  };
  const std::size_t equal = text.rfind('='), colon = text.find(':', equal);
  if (equal == std::string::npos || equal == 0 || colon == std::string::npos) throw fail();
  const auto number = [&](const std::string& word) {
    const detail::CNumbers point;
    char* end = nullptr;
    const double x = std::strtod(word.c_str(), &end);
    if (word.empty() || *end != '\0' || !std::isfinite(x)) throw fail();
    return x;
  };
  const Variation out{text.substr(0, equal), number(text.substr(equal + 1, colon - equal - 1)),
                      number(text.substr(colon + 1))};
  if (out.low > out.high)
    throw Error("vary: got '" + text + "', expected a low end that is not above the high one");
  return out;
}

Model with_varied_effects(const Model& model, const std::vector<Variation>& vary) {
  Model out = model;
  for (const Variation& v : vary) {
    if (string_parameter(out, v.parameter)) continue;
    const std::optional<EffectName> name = effect_name(v.parameter);
    if (!name)
      throw ModelError(
          "vary: got '" + v.parameter +
          "', expected WHERE.EFFECT.PARAMETER, e.g. string.string_mass.mass_ratio (see "
          "`diffnea effects`), or of a ball on a string string.length, "
          "string.attachment_x, _y, _z");
    EffectSpec* spec = find(out, *name);
    if (!spec) {
      out.effects.push_back({name->effect, name->where, {}});
      spec = &out.effects.back();
    }
    *spec = to_spec(bind(*spec, out));  // throws where there is no such effect or place
    if (std::ranges::find(spec->parameters, name->parameter, &EffectParameter::name) ==
        spec->parameters.end()) {
      std::string names;
      for (const EffectParameter& p : spec->parameters)
        names += (names.empty() ? "" : ", ") + p.name;
      throw ModelError("vary: " + name->effect + " has no parameter '" + name->parameter +
                       "'; parameters: " + names);
    }
  }
  return out;
}

std::vector<Model> draw_models(const Model& model, int count, std::uint64_t seed,
                               const std::vector<Variation>& vary) {
  if (count < 1)
    throw Error("draw_models: count: got " + std::to_string(count) + ", expected 1 or more");
  if (!model.posterior && vary.empty())
    throw ModelError(
        (model.source.empty() ? "the model" : model.source) +
        ": has no posterior to draw from; give the model.json that `identify` wrote (of the arm, "
        "then of the ball), or say what varies, e.g. string.string_mass.mass_ratio=0:0.1");
  const Model full = with_varied_effects(model, vary);
  for (const Variation& v : vary) {
    Model tried = full;
    for (const double end : {v.low, v.high}) set_varied(tried, v.parameter, end);
  }
  std::optional<Sampler> sampler;
  if (full.posterior) sampler.emplace(full);
  Rng rng(seed);
  std::vector<Model> out;
  for (int k = 0; k < count; ++k) {
    Model drawn = sampler ? sampler->draw(rng) : full;
    for (const Variation& v : vary) set_varied(drawn, v.parameter, rng.uniform(v.low, v.high));
    out.push_back(std::move(drawn));
  }
  return out;
}

bool knows_arm(const Posterior& posterior) {
  return std::ranges::any_of(posterior.names, [](const auto& n) { return !of_ball(n); });
}

Posterior joined(const Posterior* arm, const Posterior* ball) {
  Posterior out = arm ? part(*arm, false) : Posterior{};
  if (arm) out.recordings = arm->recordings;
  if (!ball) return out;
  const Posterior right = part(*ball, true);
  const std::size_t a = out.names.size(), b = right.names.size(), n = a + b;
  std::vector<double> information(n * n, 0.0);
  for (std::size_t i = 0; i < a; ++i)
    for (std::size_t j = 0; j < a; ++j) information[i * n + j] = out.information[i * a + j];
  for (std::size_t i = 0; i < b; ++i)
    for (std::size_t j = 0; j < b; ++j)
      information[(a + i) * n + a + j] = right.information[i * b + j];
  out.names.insert(out.names.end(), right.names.begin(), right.names.end());
  out.mean.insert(out.mean.end(), right.mean.begin(), right.mean.end());
  out.information = std::move(information);
  return out;
}

}  // namespace diffnea
