#pragma once
/// What fits of a ball are asked: how far they may be off, and from where they begin.

#include <cmath>
#include <string>
#include <support/camera_ball.hpp>

#include <catch2/catch_test_macros.hpp>

#include "support/found.hpp"

namespace diffnea::test {

constexpr double kNoise = 1.5e-3;  ///< of the camera [m]
/// Standard errors that an estimate may be off by: 4 of 40 checked numbers happens once in 400.
constexpr double kSigmas = 4.0;
/// What the joints' filter leaves of the hand's motion [m]; 0.1 mm on the length (observed).
constexpr double kHand = 2e-4;

inline void check_string(const IdentifyResult& result, const StringSpec& truth) {
  const auto check = [&](const std::string& name, double expected) {
    const ParameterEstimate& p = find(result, name);
    CAPTURE(name, p.value, expected, p.std);
    CHECK(p.identifiable);
    CHECK(std::abs(p.value - expected) < kSigmas * p.std + kHand);
    CHECK(std::abs(p.value - expected) < 2e-3);
  };
  check("string.length", truth.length);
  check("string.attachment_x", truth.p_LS.x);
  check("string.attachment_y", truth.p_LS.y);
  check("string.attachment_z", truth.p_LS.z);
}

/// The arm before the fit: another length, tied elsewhere.
inline Model nominal_arm(double length = 0.2) {
  Model model = swinging_arm();
  model.ball->string->length = length;
  model.ball->string->p_LS = {0.25, 0.0, 0.08};
  return model;
}

}  // namespace diffnea::test
