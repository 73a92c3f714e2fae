#pragma once
/// What terms are worth on rows that no fit has seen. Internal to diagnose/.
///
/// The fitted rows know the base parameters within errors, and another motion makes more of these
/// than of the noise. A prediction e = y − X x̂ has the covariance I + X P Xᵀ, P that of x̂, so that
/// its likelihood is eᵀ(I + X P Xᵀ)⁻¹e = min over δ of ‖e − X δ‖² + δᵀP⁻¹δ: base parameters that
/// suit both, at what that costs on the fitted rows (Gelman et al. 2013, sec. 14.3). With x̂ as it
/// is, what a cause removes drowns in what the base is wrong by, or what it adds hides there.

#include <cstdint>
#include <string>

#include "diagnose/gain.hpp"
#include "diagnose/search.hpp"

namespace diffnea {

/// Of an interval, at least: one of three would be drawn alone in 3.7 % of the draws, and be its
/// end by itself; one alone would be both ends.
inline constexpr std::size_t kFewestBlocks = 4;

/// @param sample  of held-out recordings
/// @throws DataError if they are shorter than so many blocks
void require_blocks(const std::vector<Recording>& sample);
/// @param test    held-out rows
/// @param sample  what they are of
/// @throws DataError if they hold fewer blocks than that
void require_blocks(const Evidence& test, const std::vector<Recording>& sample);

/// A joint whose torque is off by a constant on held-out rows.
struct HeldOutOffset {
  int joint = -1;
  double mean = 0.0, std = 0.0;  ///< [N·m] or [N]; of means over blocks
  double share = 0.0;            ///< of the mean square error of rows in which it moves
};

/// A model on held-out rows, at the base parameters that suit these and the fitted rows.
struct Prediction {
  VecX<double> left;   ///< (rows()) errors in units of noise; 0 in rows that do not count
  double moved = 0.0;  ///< χ² that it costs on the fitted rows
};

class HeldOut {
 public:
  /// @param used  (rows()) rows that are held out; empty: all
  HeldOut(const Evidence& evidence, std::vector<bool> used, std::uint64_t seed)
      : evidence_(evidence), used_(std::move(used)), seed_(seed) {}

  /// Torque error of the model with `terms`, base and terms as fitted by `search`, (rows()) [N·m]
  /// or [N]; what a term has of its own in each run is fitted here.
  VecX<double> errors(const Search& search, const std::vector<Term>& terms) const;
  /// The same with another torque beside the terms: `there` on the fitted rows, `here` on these.
  VecX<double> errors_with(const Search& search, const std::vector<Term>& terms, VecX<double> there,
                           VecX<double> here) const;
  /// Makes errors units of noise; 0 in rows that do not count.
  Whitener whitener(const Search& search) const {
    return {evidence_, search.whitener().noise(), used_};
  }

  /// The model with `terms`, of which errors() are.
  Prediction predicted(const Search& search, const std::vector<Term>& terms) const;
  Prediction predicted(const Search& search, const VecX<double>& errors) const;

  /// Blocks of consecutive instants are drawn with replacement (Künsch 1989), all joints together:
  /// of a second, or of half a second and more where there are less than eight seconds. Of fewer
  /// than kFewestBlocks the interval holds 0. What moving the base costs, all blocks pay alike.
  HeldOutChange compare(const Prediction& before, const Prediction& after) const;

  /// The terms in an order in which each removes most of the mean square that those before it leave,
  /// that of each joint counting alike, with its share of what all of them remove; NaN where they
  /// remove nothing.
  std::vector<std::pair<std::size_t, double>> shares(const Search& search,
                                                     const std::vector<Term>& terms) const;

  /// Joints whose error, while they move, has a mean that is beyond doubt and a good part of it.
  std::vector<HeldOutOffset> offsets(const VecX<double>& errors) const;

  const Evidence& evidence() const { return evidence_; }
  const std::vector<bool>& used() const { return used_; }

 private:
  /// Takes each run's mean out of a joint's errors.
  void take_means(int joint, VecX<double>& errors) const;

  /// Knowledge of the free base parameters in fitted and held-out rows.
  struct Known {
    long revision = -1;                             ///< search's projection that it belongs to
    MatX<double> root;                              ///< of the fitted rows
    MatX<double> columns;                           ///< held-out rows, whitened
    VecX<double> scale;                             ///< makes columns of both one long
    Eigen::ColPivHouseholderQR<MatX<double>> both;  ///< [root; columns] · scale
  };
  const Known& known(const Search& search) const;

  const Evidence& evidence_;
  std::vector<bool> used_;
  std::uint64_t seed_;
  mutable Known known_;
};

}  // namespace diffnea
