#include "free_world.hpp"

#include <algorithm>

#include <diffnea/core/error.hpp>

namespace diffnea::python {
namespace {

/// Tells whether a number has this name, or is a part of what has it.
bool belongs(const std::string& number, const std::string& name) {
  return number.starts_with(name) &&
         (number.size() == name.size() || number[name.size()] == '.' || number[name.size()] == '[');
}

/// Names of what holds numbers: "rod.p_AP" of "rod.p_AP[0]".
std::string holder(const std::string& number) {
  const std::size_t dot = number.find('.');
  return number.substr(0, number.find_first_of(".[", dot + 1));
}

/// [i,j] of entry k of an array, nothing of a number.
std::string index_text(const std::vector<py::ssize_t>& shape, std::size_t k) {
  std::string out;
  for (auto n = shape.rbegin(); n != shape.rend(); ++n) {
    const auto size = static_cast<std::size_t>(*n);
    out = std::to_string(k % size) + (out.empty() ? "" : "," + out);
    k /= size;
  }
  return out.empty() ? out : "[" + out + "]";
}

Theta<double> theta_of(const Body& body) {
  Theta<double> out;
  std::copy(body.theta.begin(), body.theta.end(), out.begin());
  return out;
}

}  // namespace

FreeWorld::FreeWorld(std::vector<Body> bodies, std::vector<NamedConstraint> constraints,
                     const std::vector<std::string>& free)
    : bodies_(std::move(bodies)), constraints_(std::move(constraints)) {
  require_distinct("fit_constrained", constraints_);
  for (std::size_t b = 0; b < bodies_.size(); ++b) list_body(b);
  for (const NamedConstraint& c : constraints_) list_constraint(c);
  set_free(free);
  for (std::size_t b = 0; b < bodies_.size(); ++b) set_coordinates(b);
  for (std::size_t k = 0; k < all_.size(); ++k)
    if (place_[k] >= 0) parameters_.push_back(all_[k]);
}

void FreeWorld::list_body(std::size_t b) {
  of_body_.push_back(all_.size());
  const std::string name = "bodies[" + std::to_string(b) + "].";
  if (bodies_[b].kind == BodyKind::kPrescribed) return;
  all_.push_back({name + "mass", "kg", bodies_[b].theta[0], Sign::kPositive});
  if (bodies_[b].kind == BodyKind::kParticle) return;
  for (int k = 0; k < 3; ++k)
    all_.push_back({name + "com[" + std::to_string(k) + "]", "m",
                    bodies_[b].theta[1 + k] / bodies_[b].theta[0]});
  const Sym3<double> I =
      inertia_about_com(SpatialInertia<double>::from_theta(theta_of(bodies_[b])));
  const double entries[]{I.xx, I.xy, I.xz, I.yy, I.yz, I.zz};
  for (int k = 0; k < 6; ++k) {
    const bool diagonal = k == 0 || k == 3 || k == 5;
    all_.push_back({name + "inertia." + kThetaNames[4 + k], "kg*m^2", entries[k],
                    diagonal ? Sign::kPositive : Sign::kFree});
  }
}

void FreeWorld::list_constraint(const NamedConstraint& c) {
  of_constraint_.push_back(all_.size());
  direction_.resize(all_.size(), false);
  for (std::size_t i = 0; i < c.shapes.size(); ++i) {
    const ParameterShape& shape = c.shapes[i];
    const std::string name = c.name + "." + shape.name;
    for (std::size_t k = 0; k < shape.unknowns(); ++k) {
      static constexpr std::array kPose{".rx", ".ry", ".rz", ".x", ".y", ".z"};
      const std::string part = shape.is_pose() ? kPose[k] : index_text(shape.shape, k);
      const std::string unit = shape.is_pose() ? (k < 3 ? "rad" : "m") : c.function ? "" : "m";
      all_.push_back({name + part, unit, shape.is_pose() ? 0.0 : c.parameters[i][k],
                      shape.positive ? Sign::kPositive : Sign::kFree});
      direction_.push_back(shape.unit);
    }
  }
}

void FreeWorld::set_free(const std::vector<std::string>& free) {
  direction_.resize(all_.size(), false);
  std::vector<bool> is_free(all_.size(), false);
  for (const std::string& name : free) {
    bool found = false;
    for (std::size_t k = 0; k < all_.size(); ++k)
      if (belongs(all_[k].name, name)) found = is_free[k] = true;
    if (found) continue;
    std::string choices;
    for (std::size_t k = 0; k < all_.size(); ++k)
      if (!direction_[k] && (k == 0 || holder(all_[k].name) != holder(all_[k - 1].name)))
        choices += (choices.empty() ? "" : ", ") + holder(all_[k].name);
    throw Error("fit_constrained: free: got '" + name + "'; choices: " + choices);
  }
  for (std::size_t k = 0, next = 0; k < all_.size(); ++k) {
    if (is_free[k] && direction_[k])
      throw Error("fit_constrained: free: '" + holder(all_[k].name) +
                  "' is a unit vector, and cannot be free; name the other parameters, or write the "
                  "constraint as a function of the direction's angles");
    place_.push_back(is_free[k] ? static_cast<int>(next++) : -1);
  }
}

void FreeWorld::set_coordinates(std::size_t b) {
  const auto first = static_cast<std::ptrdiff_t>(of_body_[b] + kInertia);
  const auto is_free = [](int place) { return place >= 0; };
  has_coordinates_.push_back(
      bodies_[b].kind == BodyKind::kRigid &&
      std::all_of(place_.begin() + first, place_.begin() + first + 6, is_free));
  if (!has_coordinates_.back()) return;
  try {
    const Theta<double> phi = log_cholesky_from_theta(theta_of(bodies_[b]));
    for (std::size_t k = 0; k < 6; ++k) {
      all_[of_body_[b] + kInertia + k].value = phi[1 + k];
      all_[of_body_[b] + kInertia + k].sign = Sign::kFree;
    }
  } catch (const ModelError& error) {
    throw ModelError("fit_constrained: bodies[" + std::to_string(b) +
                     "].inertia is free, and begins where no body can be: " + error.what());
  }
}

std::vector<Body> FreeWorld::bodies_at(const VecX<double>& p) const {
  std::vector<Body> out = bodies_;
  for (std::size_t b = 0; b < out.size(); ++b) {
    const Theta<double> theta = inertia_at(b, p).theta();
    std::copy(theta.begin(), theta.end(), out[b].theta.begin());
  }
  return out;
}

std::vector<NamedConstraint> FreeWorld::constraints_at(const VecX<double>& p) const {
  std::vector<NamedConstraint> out = constraints_;
  for (std::size_t c = 0; c < out.size(); ++c) out[c].parameters = numbers_at(c, p);
  return out;
}

}  // namespace diffnea::python
