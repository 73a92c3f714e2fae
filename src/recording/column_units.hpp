#pragma once
/// Units of columns, as a header has them in brackets. Internal.
///
///     q_elbow [deg]                      a unit
///     q_elbow [0.087890625*deg-180]      a law of raw counts c: 0.087890625 c − 180, in deg
///     tau_elbow [0.00269*A mod 65536]    two's complement of 16 bits: c − 65536 from 32768 on

#include <string>
#include <string_view>
#include <vector>

namespace diffnea::detail {

enum class Channel {
  kTime,
  kRun,
  kQ,
  kQd,
  kQdd,
  kQcmd,
  kQdcmd,
  kTaucmd,
  kTau,
  kBall,
  kSpin,
  kBasePosition,    ///< p_WB
  kBaseQuaternion,  ///< quaternion of R_WB
  kBaseTurning,     ///< ω of the base's twist
  kBaseVelocity,    ///< v of it
  kBaseTorque,      ///< τ of the wrench on the base
  kBaseForce,       ///< f of it
  kExtra,
  kLeftOut
};

/// From a cell to SI: scale · wrapped(x) + offset.
struct Conversion {
  double scale = 1.0;
  double offset = 0.0;
  double modulus = 0.0;  ///< above 0: x counts as x − modulus from its half on

  double operator()(double x) const {
    if (modulus > 0.0 && x >= 0.5 * modulus) x -= modulus;
    return scale * x + offset;
  }
};

/// A unit of turning ("deg/s", "N*m"), of sliding ("mm", "N"), or of neither ("A").
enum class Motion { kTurns, kSlides, kEither };

/// Meaning of what stands in brackets.
struct UnitOfColumn {
  std::string unit;       ///< plain, without the law: "deg"
  Conversion conversion;  ///< but for what a drive's unit is worth in N·m
  Motion motion = Motion::kEither;
  bool of_drive = false;  ///< A, mA, V, %: a torque only by what one is worth
};

/// "N·m" → "N*m", "rad/s²" → "rad/s^2", "°" → "deg", "µs" → "us".
std::string plain_unit(std::string_view unit);

/// Names of the units that a channel can have; those of a drive with them.
std::vector<std::string> unit_names(Channel channel);

/// @param text  plain
/// @throws DataError that begins with "unit '…'" and lists what is known
UnitOfColumn parse_unit(Channel channel, const std::string& text);

/// Name of the channel in a message.
const char* channel_name(Channel channel);

}  // namespace diffnea::detail
