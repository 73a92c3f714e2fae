#pragma once
/// All effects there are, with their formulas: whoever includes it is compiled again when one of
/// them changes. What needs names and numbers alone includes effects/bound_effect.hpp.

#include <variant>

#include <diffnea/effects/actuator_delay.hpp>
#include <diffnea/effects/actuator_lag.hpp>
#include <diffnea/effects/armature.hpp>
#include <diffnea/effects/asymmetric_coulomb.hpp>
#include <diffnea/effects/asymmetric_viscous.hpp>
#include <diffnea/effects/attachment_offset.hpp>
#include <diffnea/effects/backlash.hpp>
#include <diffnea/effects/base_tilt.hpp>
#include <diffnea/effects/bounce.hpp>
#include <diffnea/effects/bound_effect.hpp>
#include <diffnea/effects/cable_differential_friction.hpp>
#include <diffnea/effects/camera_delay.hpp>
#include <diffnea/effects/camera_offset.hpp>
#include <diffnea/effects/camera_rotation.hpp>
#include <diffnea/effects/camera_scale.hpp>
#include <diffnea/effects/cogging.hpp>
#include <diffnea/effects/coulomb_friction.hpp>
#include <diffnea/effects/dry_drag.hpp>
#include <diffnea/effects/encoder_offset.hpp>
#include <diffnea/effects/encoder_scale.hpp>
#include <diffnea/effects/feed_forward.hpp>
#include <diffnea/effects/gravity_scale.hpp>
#include <diffnea/effects/integral_action.hpp>
#include <diffnea/effects/joint_elasticity.hpp>
#include <diffnea/effects/joint_spring.hpp>
#include <diffnea/effects/linear_drag.hpp>
#include <diffnea/effects/load_friction.hpp>
#include <diffnea/effects/magnus.hpp>
#include <diffnea/effects/payload.hpp>
#include <diffnea/effects/position_servo.hpp>
#include <diffnea/effects/presliding_dahl.hpp>
#include <diffnea/effects/presliding_lugre.hpp>
#include <diffnea/effects/quadratic_drag.hpp>
#include <diffnea/effects/quadratic_friction.hpp>
#include <diffnea/effects/residual.hpp>
#include <diffnea/effects/saturation.hpp>
#include <diffnea/effects/session_offset.hpp>
#include <diffnea/effects/stribeck_friction.hpp>
#include <diffnea/effects/string_bending.hpp>
#include <diffnea/effects/string_damping.hpp>
#include <diffnea/effects/string_extension.hpp>
#include <diffnea/effects/string_folding.hpp>
#include <diffnea/effects/string_mass.hpp>
#include <diffnea/effects/string_rebound.hpp>
#include <diffnea/effects/string_wrap.hpp>
#include <diffnea/effects/sublinear_friction.hpp>
#include <diffnea/effects/supply_sag.hpp>
#include <diffnea/effects/time_shift.hpp>
#include <diffnea/effects/tip_force.hpp>
#include <diffnea/effects/torque_gain.hpp>
#include <diffnea/effects/torque_offset.hpp>
#include <diffnea/effects/transmission_coupling.hpp>
#include <diffnea/effects/velocity_filter_lag.hpp>
#include <diffnea/effects/viscous_friction.hpp>
#include <diffnea/effects/warm_up.hpp>
#include <diffnea/effects/wind.hpp>

namespace diffnea {

/// One line per effect, sorted. This list is the catalogue.
using EffectVariant = std::variant<  //
    ActuatorDelay,                   //
    ActuatorLag,                     //
    Armature,                        //
    AsymmetricCoulomb,               //
    AsymmetricViscous,               //
    AttachmentOffset,                //
    Backlash,                        //
    BaseTilt,                        //
    Bounce,                          //
    CableDifferentialFriction,       //
    CameraDelay,                     //
    CameraOffset,                    //
    CameraRotation,                  //
    CameraScale,                     //
    Cogging,                         //
    CoulombFriction,                 //
    DryDrag,                         //
    EncoderOffset,                   //
    EncoderScale,                    //
    FeedForward,                     //
    GravityScale,                    //
    IntegralAction,                  //
    JointElasticity,                 //
    JointSpring,                     //
    LinearDrag,                      //
    LoadFriction,                    //
    Magnus,                          //
    Payload,                         //
    PositionServo,                   //
    PreslidingDahl,                  //
    PreslidingLugre,                 //
    QuadraticDrag,                   //
    QuadraticFriction,               //
    Residual,                        //
    Saturation,                      //
    SessionOffset,                   //
    StribeckFriction,                //
    StringBending,                   //
    StringDamping,                   //
    StringExtension,                 //
    StringFolding,                   //
    StringMass,                      //
    StringRebound,                   //
    StringWrap,                      //
    SublinearFriction,               //
    SupplySag,                       //
    TimeShift,                       //
    TipForce,                        //
    TorqueGain,                      //
    TorqueOffset,                    //
    TransmissionCoupling,            //
    VelocityFilterLag,               //
    ViscousFriction,                 //
    WarmUp,                          //
    Wind>;

/// One of them, as BoundEffect holds it.
struct AnyEffect : EffectVariant {
  using EffectVariant::EffectVariant;
};

/// Calls `visit` with the effect's formula.
template <class Visit>
decltype(auto) visit_formula(const BoundEffect& effect, Visit&& visit) {
  return std::visit(std::forward<Visit>(visit), static_cast<const EffectVariant&>(*effect.type));
}

}  // namespace diffnea

#include <diffnea/effects/detail/catalogue_impl.hpp>
