/// The model that effects of torque refer to, where the test's base is none that a model can hold.

#include "diagnose/reference.hpp"

#include <support/swinging.hpp>

#include <catch2/catch_test_macros.hpp>

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

TEST_CASE("Reference: a rotor below 0 is taken over by the link that it turns", "[diagnose]") {
  test::SwingingEvidence s(40.0, false, 1, "armature");
  const long p = static_cast<long>(s.layout.linear.size());
  VecX<double> x = VecX<double>::Zero(s->base().cols());
  x.head(p) = s.layout.prior();
  const long rotor = index_of(s.layout, "shoulder.armature.armature"),
             inertia = index_of(s.layout, "upper.Iyy");
  x[rotor] = -0.05;  // [kg m²]
  x[inertia] += 0.05;
  const Reference reference(s.model, s.layout, *s.evidence, nullptr);
  std::vector<std::string> notes;
  FitChoice choice;
  choice.effects = std::vector<std::string>{"armature"};
  const VecX<double> held =
      layout_for(reference.extended(x, {}), *s.source, nullptr, choice, notes).prior();
  REQUIRE(held.size() == p);
  CHECK(held[rotor] >= 0.0);
  const MatX<double> A = s->base().leftCols(p);
  const double torque = (A * x.head(p)).norm();
  CHECK((A * (held - x.head(p))).norm() < 1e-6 * torque);  // the ridge's share
  VecX<double> clipped = x.head(p);
  clipped[rotor] = 0.0;
  CHECK((A * (clipped - x.head(p))).norm() > 1e-3 * torque);  // what would be missing
}

}  // namespace reference_test
