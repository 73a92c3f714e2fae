#pragma once
/// What one planned motion would show of a cause and its rival: the expected ΔBIC between them.
/// Internal to diagnose/.

#include <vector>

#include "diagnose/next_experiment.hpp"

namespace diffnea {

/// A cause and a rival of its class.
struct CausePair {
  std::size_t term;  ///< of the context
  const Candidate* rival;
  double now;  ///< ΔBIC of the recording
};

/// What one motion would show.
class ExperimentTrial {
 public:
  /// @param c           outlives this
  /// @param fastest_hz  harmonic of the motion
  ExperimentTrial(const ExperimentContext& c, const Trajectory& motion, double fastest_hz);

  /// Expected ΔBIC of the rival in the cause's place, over an experiment of `duration` [s].
  double separation(const CausePair& pair, double duration);

 private:
  /// Orthonormal basis of what the other causes may take: their columns, shapes too.
  MatX<double> basis_without(std::size_t term);
  /// Whitened, beside the base and the other causes.
  MatX<double> beside(const MatX<double>& columns) const;
  /// ‖g − rival‖² at the rival's best parameters.
  double least(const VecX<double>& g, const Candidate& rival) const;
  /// One Gauss–Newton step, halved until it helps; parameters keep their signs.
  /// @return the new sum of squares; `effect` holds the parameters
  double step(const VecX<double>& g, const Candidate& rival, const std::vector<int>& which,
              TriedEffect& effect, double now) const;

  const ExperimentContext& context_;
  Evidence evidence_;
  Whitener whitener_;
  Projection projection_;
  double seconds_;       ///< of the motion
  std::vector<MatX<double>> columns_;  ///< one for each cause, beside the base, once asked for
  MatX<double> others_;                ///< basis of what the other causes may take
};

}  // namespace diffnea
