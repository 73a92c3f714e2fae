/// The model that effects of torque refer to, where the test's base is none that a model can hold.

#include "diagnose/reference.hpp"

#include <support/swinging.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>

#include <diffnea/model/physical.hpp>

namespace reference_test {

using namespace diffnea;

namespace {

long index_of(const FitLayout& layout, const std::string& name) {
  const auto it = std::ranges::find(layout.linear, name, &FitParameter::name);
  REQUIRE(it != layout.linear.end());
  REQUIRE_FALSE(it->fixed);
  return it - layout.linear.begin();
}

}  // namespace

TEST_CASE("Reference: a rotor and the link that it turns share an inertia as a robot can",
          "[diagnose]") {
  const double moved = GENERATE(-0.05, 0.5);  // to a rotor below 0, to a link that none is
  test::SwingingEvidence s(40.0, false, 1, "armature");
  const long p = static_cast<long>(s.layout.linear.size());
  VecX<double> x = VecX<double>::Zero(s->base().cols());
  x.head(p) = s.layout.prior();
  const long rotor = index_of(s.layout, "shoulder.armature.armature"),
             mass = index_of(s.layout, "upper.mass"), inertia = index_of(s.layout, "upper.Iyy");
  x[rotor] = moved;  // [kg m²]
  x[inertia] -= moved;
  const Reference reference(s.model, s.layout, *s.evidence, nullptr);
  std::vector<std::string> notes;
  FitChoice choice;
  choice.effects = std::vector<std::string>{"armature"};
  const VecX<double> held =
      layout_for(reference.extended(x, {}), *s.source, nullptr, choice, notes).prior();
  REQUIRE(held.size() == p);
  CHECK(held[rotor] >= 0.0);
  Theta<double> theta;
  for (int k = 0; k < kThetaSize; ++k) theta[k] = held[mass + k];
  CHECK(smallest_pseudo_inertia_eigenvalue(theta) > 0.0);
  const MatX<double> A = s->base().leftCols(p);
  const double torque = (A * x.head(p)).norm();
  CHECK((A * (held - x.head(p))).norm() < 1e-6 * torque);  // the weak prior's share
  VecX<double> clipped = x.head(p);
  clipped[rotor] = 0.0;
  CHECK((A * (clipped - x.head(p))).norm() > 1e-3 * torque);  // what would be missing
}

}  // namespace reference_test
