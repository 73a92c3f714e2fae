#pragma once
/// Every candidate at every point of its grid, scored beside the terms that are there: the
/// Lagrange-multiplier test of each, with the signs of its parameters kept. Columns are whitened
/// once and what the base leaves of them is kept, so that scoring beside other terms costs a
/// product with those terms. Internal to diagnose/.

#include <functional>

#include "diagnose/projection.hpp"
#include "diagnose/term.hpp"

namespace diffnea {

/// The score of one candidate beside the terms that are there.
struct Score {
  int candidate = -1;
  int variant = -1;
  int parameters = 0;
  double gain = 0.0;  ///< removed from χ²
  double delta_bic = 0.0;
  double visible_share = 0.0;  ///< ‖G⊥‖/‖G‖ beside the base alone
};

/// Which candidates are scored, by their index.
using Wanted = std::function<bool(int)>;

class ScoreTable {
 public:
  /// @param table_bytes  most that ripples' columns may take; beyond, they are made anew whenever
  ///   they are scored, with the same results
  ScoreTable(const Evidence& evidence, const std::vector<Candidate>& candidates,
             double table_bytes);

  /// The columns of candidates that refer to the model, at joints whose reference has moved.
  void recompute(const std::vector<bool>& joints);
  /// Whitens all columns, and keeps what the base leaves of them and their share of its residual.
  void measure(const Projection& projection);

  /// The best variant of each candidate, in their order, without ΔBIC; as of the last measure().
  /// @param wanted  the others have no variant; nothing: all
  std::vector<Score> scores(const std::vector<Term>& terms, const NormalEquations& of_terms,
                            const Projection& projection, const Wanted& wanted) const;
  /// Where on its candidate's grid a score is: values of its shapes, then of its choices.
  const std::vector<double>& point_of(const Score& score) const;
  /// The variant of a score as a term without columns.
  Term term_of(const Score& score) const;

 private:
  /// A candidate at one point of its grid: columns [∂τ/∂p | torque that comes with coefficient 1]
  /// in the rows of the joints that it reaches.
  struct Variant {
    int candidate;
    int point;
    bool offset;
    std::vector<long> joints;  ///< indices into evidence.joints()
    bool kept = true;          ///< `raw` and the whitened columns; else sweep() makes them anew
    MatX<double> raw;          ///< (joints · times(), width + offset)
    Beside beside;
    VecX<double> norms;          ///< of whitened columns
    MatX<double> gram;           ///< of what the base leaves of them
    VecX<double> with_residual;  ///< products of the same with its residual

    long width() const { return gram.cols() - offset; }
  };
  void fill(Variant& variant) const;
  void add_ripples(int candidate, bool keep);
  /// Makes the columns of every wanted variant that is not kept and hands its index and them to
  /// `visit`.
  void sweep(const Wanted& wanted,
             const std::function<void(std::size_t, const MatX<double>&)>& visit) const;
  void measure(Variant& variant, Beside beside, const Projection& projection) const;

  const Evidence& evidence_;
  const std::vector<Candidate>& candidates_;
  std::vector<Variant> variants_;
};

}  // namespace diffnea
