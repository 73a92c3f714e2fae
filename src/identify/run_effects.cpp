#include "identify/run_effects.hpp"

#include <algorithm>
#include <cstdio>

#include <diffnea/core/error.hpp>
#include <diffnea/model/physical.hpp>

namespace diffnea {
namespace {

bool names_runs(const std::string& text) { return text.find(":run=") != std::string::npos; }

/// The parameters of a body that are known, in the order of kThetaNames.
std::vector<double> known_theta(const HeldBody& body, const std::string& where) {
  if (!body.mass) return {};
  if (!body.com) return {*body.mass};
  const Vec3<double> com{(*body.com)[0], (*body.com)[1], (*body.com)[2]};
  Sym3<double> I;
  if (body.about_com) {
    const auto& a = *body.about_com;
    I = {a[0], a[1], a[2], a[3], a[4], a[5]};
  }
  const Theta<double> theta = inertia_from_com<double>(*body.mass, com, I).theta();
  if (!body.about_com) return {theta.begin(), theta.begin() + 4};
  // Rounding alone may leave a flat body this far outside.
  if (smallest_pseudo_inertia_eigenvalue(theta) <
      -1e-9 * (theta[0] + theta[4] + theta[7] + theta[9]))
    throw DataError(
        where +
        ": payload: no body has this inertia about its center of mass (about_com: Ixx Ixy "
        "Ixz Iyy Iyz Izz; none may exceed the sum of the other two on the diagonal)");
  return {theta.begin(), theta.end()};
}

std::string list_runs(const std::vector<RunDescription>& runs) {
  std::string out;
  for (std::size_t k = 0; k < runs.size(); ++k)
    out += (k == 0 ? "" : ", ") + std::to_string(k) + " " + runs[k].source;
  return out;
}

}  // namespace

bool depends_on_runs(const Model& model, const FitChoice& choice, const RecordingSource& train,
                     const RecordingSource* test) {
  const std::vector<std::string> none;
  return std::ranges::any_of(choice.effects ? *choice.effects : none, names_runs) ||
         std::ranges::any_of(model.effects,
                             [](const EffectSpec& e) { return names_runs(e.where); }) ||
         train.holds_payload() || (test && test->holds_payload());
}

Model with_held_bodies(const Model& model, const std::vector<RunDescription>& runs,
                       FitChoice& choice) {
  Model out = model;
  std::vector<HeldBody> bodies;
  for (const RunDescription& r : runs)
    if (r.info.payload && std::ranges::find(bodies, *r.info.payload) == bodies.end())
      bodies.push_back(*r.info.payload);
  for (const HeldBody& body : bodies) {
    RunPlace place{body.where, {}};
    std::string first;
    for (std::size_t k = 0; k < runs.size(); ++k) {
      if (runs[k].info.payload != body) continue;
      if (first.empty()) first = runs[k].source;
      place.runs.push_back(static_cast<int>(k));
    }
    EffectSpec spec{"payload", join_where(place), {}};
    const std::vector<double> known = known_theta(body, first);
    for (std::size_t k = 0; k < known.size(); ++k) {
      spec.parameters.push_back({kThetaNames[k], known[k],
                                 k == 0  ? "kg"
                                 : k < 4 ? "kg*m"
                                         : "kg*m^2"});
      choice.fix.push_back(spec.where + ".payload." + kThetaNames[k]);
    }
    std::erase_if(out.effects,
                  [&](const EffectSpec& e) {  // the recording knows better than the model
                    return e.effect == spec.effect && e.where == spec.where;
                  });
    out.effects.push_back(spec);
  }
  return out;
}

void check_runs(const std::vector<RunDescription>& runs, int training, const Model& model,
                FitLayout& layout, std::vector<std::string>& notes) {
  for (std::size_t e = 0; e < layout.effects.size(); ++e) {
    const BoundEffect& effect = layout.effects[e];
    if (effect.runs.empty()) continue;
    const std::string name = effect.info().name + "@" + effect.where;
    const bool of_model = std::ranges::any_of(model.effects, [&](const EffectSpec& s) {
      return s.effect == effect.info().name && s.where == effect.where;
    });
    const bool exists = std::ranges::all_of(
        effect.runs, [&](int run) { return run < static_cast<int>(runs.size()); });
    const bool fitted = std::ranges::any_of(effect.runs, [&](int run) { return run < training; });
    if (!exists && !of_model)
      throw ModelError("effects: '" + name +
                       "' names a recording that does not exist; recordings: " + list_runs(runs));
    bool moves = false;
    for (auto* list : {&layout.linear, &layout.shape})
      for (FitParameter& p : *list) {
        if (p.effect != static_cast<int>(e) || p.fixed || fitted) continue;
        moves = true;
        if (of_model) p.fixed = true;
      }
    if (moves && !of_model)
      throw ModelError(
          "effects: '" + name +
          "' has parameters to fit, and none of its recordings is one of the "
          "fit's; hold them (--fix NAME=VALUE), or give such a recording; recordings: " +
          list_runs(runs));
    if (of_model)
      notes.push_back(fitted
                          ? "the model says that " + name +
                                " acts in these recordings, by their number; see that it is so: " +
                                list_runs(runs)
                          : "the model's " + name + " acts in no recording of the fit and is held");
  }
}

}  // namespace diffnea
