#pragma once
/// The measured motion of a link as a function of time: what drives the anchor of a string. Pose,
/// velocity and acceleration of the rows come from the filtered joints; between rows, a quintic
/// through all three (Hermite).

#include <array>
#include <vector>

#include <diffnea/dynamics/string_particle.hpp>
#include <diffnea/model/model.hpp>
#include <diffnea/recording/preprocess.hpp>

namespace diffnea {

/// The pose of what a string is tied to, at any time between the rows of a recording.
class HandMotion {
 public:
  /// A link that never moves (the world, or a link fixed to it), at any time.
  explicit HandMotion(const Pose<double>& X_WL);
  /// @param link  index into model.links  @param rows  of one segment
  HandMotion(const Model& model, int link, const Preprocessed& smooth, long first, long rows);

  double begin() const { return begin_; }  ///< [s]
  /// Time of the last row [s].
  double end() const { return begin_ + dt_ * static_cast<double>(rows_.size() - 1); }
  /// Whether the pose is known all the way between two times [s].
  bool covers(double from, double to) const { return still_ || (from >= begin_ && to <= end()); }

  template <Scalar T>
  Pose<T> pose(const T& time) const {  ///< X_WL
    const Row at = row_at(value(time));
    const T late = time - T(value(time));  // 0, with derivatives where a switch moved it
    Pose<T> out{at.x.R.template cast<T>(),
                at.x.p.template cast<T>() + at.v.p.template cast<T>() * late};
    for (int c = 0; c < 3; ++c)
      out.R.col[c] = out.R.col[c] + at.v.R.col[c].template cast<T>() * late;
    return out;
  }
  /// A point S of the link. @param p_LS in L [m]
  template <Scalar T>
  AnchorMotion<T> anchor(const T& time, const Vec3<T>& p_LS) const {
    const Row at = row_at(value(time));
    const auto point = [&](const Affine& m) -> Vec3<T> {
      return m.p.template cast<T>() + m.R.template cast<T>() * p_LS;
    };
    AnchorMotion<T> out{point(at.x), point(at.v), point(at.a)};
    if constexpr (!std::same_as<T, double>) {
      const T late = time - T(value(time));  // 0, with derivatives where a switch moved it
      out.x = out.x + out.v * late;
      out.v = out.v + out.a * late;
    }
    return out;
  }

 private:
  /// x ↦ p + R x: a pose, or its derivative.
  struct Affine {
    Mat3<double> R;
    Vec3<double> p;
  };
  struct Row {
    Affine x, v, a;
  };
  Row row_at(double time) const;

  bool still_ = false;
  double begin_ = 0.0, dt_ = 1.0;
  std::vector<Row> rows_;
};

}  // namespace diffnea
