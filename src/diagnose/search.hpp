#pragma once
/// Candidates against what the base leaves: scores, shapes, and fits of several effects at once.
/// Everything here works on columns that are whitened and projected (projection.hpp), where effects
/// are independent of the base. Internal to diagnose/.

#include <functional>
#include <memory>

#include "diagnose/candidates.hpp"
#include "diagnose/projection.hpp"

namespace diffnea {

/// An effect in the model under test: its shapes are set, its other parameters follow from a fit.
/// About the present values its torque is offset + columns · p.
struct Term {
  int candidate = -1;
  TriedEffect effect;
  std::vector<int> linear,
      shapes;  ///< as the candidate's; without shapes that the linear parameters stand in for
  MatX<double> columns;    ///< (rows(), linear) ∂τ/∂p
  VecX<double> offset;     ///< (rows()); empty where the torque is linear in p
  MatX<double> projected;  ///< whitened, beside the base: [columns | offset]
  double norm = 0.0;       ///< of the torque, whitened

  int rank = 0;  ///< of `linear` that this recording shows beside the base

  int num_parameters() const { return rank + static_cast<int>(shapes.size()); }
  long width() const { return columns.cols(); }
  bool has_offset() const { return offset.size() > 0; }
  VecX<double> values() const;
  VecX<double> torque() const;
  /// Of the torque's whitened norm, what the base leaves.
  double visible_share() const;
};

/// The score of one candidate beside the terms that are there.
struct Score {
  int candidate = -1;
  int variant = -1;
  int parameters = 0;
  double gain = 0.0;  ///< removed from χ²
  double delta_bic = 0.0;
  double visible_share = 0.0;  ///< ‖G⊥‖/‖G‖ beside the base alone
};

class Search {
 public:
  /// @param table_bytes  most that ripples' columns may take; beyond, they are made anew whenever
  ///   they are scored, with the same results. By default 50 Hz and six joints fill it in two
  ///   minutes.
  Search(const Evidence& evidence, const std::vector<Candidate>& candidates, const BasePrior& prior,
         const std::vector<bool>& used, double table_bytes = 256e6);

  /// Noise from `period` where the motion repeats, else from what base and terms leave; whitens and
  /// projects anew.
  void refresh(double period, std::vector<Term>& terms);
  /// The candidates' columns, after the evidence's reference has moved; refresh() next.
  void recompute();

  /// Every candidate beside `terms`, best first.
  std::vector<Score> scores(const std::vector<Term>& terms) const;
  /// The candidate of a score as a term, its shapes refined beside `terms` (Gauss–Newton in their
  /// logarithms), with the best of its choices.
  Term refined(const Score& score, const std::vector<Term>& terms) const;
  Term refined(Term term, const std::vector<Term>& terms) const;
  /// A torque as large as the joint's whole torque is no effect but a failed fit.
  bool plausible(const Term& term) const;

  /// Linear parameters of all terms together; sets their values. @return what they remove from χ²
  double fit(std::vector<Term>& terms) const;
  double gain_of(const std::vector<Term>& terms) const;
  /// The same at the parameters as they are.
  double gain_at(const std::vector<Term>& terms) const;
  /// BIC of a gain, lower is better, relative to the base alone.
  double bic(double gain, const std::vector<Term>& terms) const;
  int num_parameters(const std::vector<Term>& terms) const;

  /// Covariance of each term's parameters, linear ones first, then shapes (of their logarithm).
  std::vector<MatX<double>> covariances(const std::vector<Term>& terms) const;
  /// How much of a term's projected torque another one can take over together with those that are
  /// there, 0 … 1.
  double replaced_share(const Term& term, const Term& by, const std::vector<Term>& beside) const;

  /// χ² at the joints that `term` reaches which `terms` leave because their columns are not exact:
  /// (2 %)² of what they remove, where one of them is dry friction (4 %)².
  double inexact_at(const Term& term, const std::vector<Term>& terms) const;

  /// What a fit costs, −2 ln of its likelihood but for a constant: n ln χ², the noise as large as
  /// what is left; where repeats have told the noise and no more is left, χ².
  double cost(double chi2) const;

  const Projection& projection() const { return *projection_; }
  const Whitener& whitener() const { return *whitener_; }
  double residual_sum() const { return projection_->residual().squaredNorm(); }
  long rows() const { return projection_->rows(); }
  bool noise_is_repeatable() const { return repeatable_; }
  /// The residual of torque at the base that goes with the terms, (rows()).
  VecX<double> residual(const std::vector<Term>& terms) const;

  /// RMS of the term's torque over that of the measured torque, at the joints it acts on.
  double torque_share(const Term& term) const;

 private:
  /// A candidate at one point of its grid: columns [∂τ/∂p | torque that comes with coefficient 1]
  /// in the rows of the joints that it reaches.
  struct Variant {
    int candidate;
    int point;
    bool offset;
    std::vector<long> joints;  ///< indices into evidence.joints()
    bool kept = true;          ///< `raw` and `whitened`; else they are made anew by sweep()
    MatX<double> raw;          ///< (joints · times(), width + offset)
    MatX<double> whitened;
    VecX<double> norms;  ///< of whitened columns
    MatX<double> gram;   ///< of the projected ones
    VecX<double> onto;   ///< projected columns times the residual

    long width() const { return gram.cols() - offset; }
  };
  Term make_term(int candidate, const std::vector<double>& point) const;
  /// Its shapes refined, its choices as they are.
  Term descended(Term term, const std::vector<Term>& terms) const;
  /// Where stiffness and rotor of a spring show as their ratio alone: the rotor as declared.
  void hold_rotor(Term& term) const;
  void fill(Variant& variant) const;
  void add_ripples(int candidate, bool keep);
  /// Makes the columns of every variant that is not kept and hands its index and them to `visit`.
  void sweep(const std::function<void(std::size_t, const MatX<double>&)>& visit) const;
  /// Whitens a variant's columns; what the base leaves of them, and their share of the residual.
  void measure(Variant& variant, const MatX<double>& raw) const;
  void set_columns(Term& term) const;
  /// What the best of a candidate's starts is worth less for being the best of many (Bonferroni).
  double looked_elsewhere(int candidate) const;
  bool drop_redundant(const MatX<double>& G, const MatX<double>& D, Term& term) const;
  std::vector<bool> signs_of(const std::vector<Term>& terms) const;

  const Evidence& evidence_;
  const std::vector<Candidate>& candidates_;
  const BasePrior& prior_;
  std::vector<bool> used_;
  std::vector<Variant> variants_;
  std::unique_ptr<Whitener> whitener_;
  std::unique_ptr<Projection> projection_;
  bool repeatable_ = false;
};

}  // namespace diffnea
