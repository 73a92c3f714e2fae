#pragma once
/// The model whose torques effects refer to: the base as fitted beside the causes so far. Internal
/// to diagnose/.

#include <vector>

#include "diagnose/search.hpp"

namespace diffnea {

/// Its shapes at parameters x, that go with these causes, in the order of the layout.
VecX<double> shapes_at(const FitLayout& layout, const VecX<double>& x,
                       const std::vector<Term>& terms);
/// The base model at parameters x, that go with these causes.
Model base_at(const Model& model, const FitLayout& layout, const VecX<double>& x,
              const std::vector<Term>& terms);

/// Moves what the columns of the fitted and of the held-out rows refer to.
class Reference {
 public:
  /// @param test  null: there is no test recording
  Reference(const Model& model, const FitLayout& layout, Evidence& train, Evidence* test)
      : model_(model), layout_(layout), train_(train), test_(test) {}

  /// Base parameters x and the causes so far.
  /// @return by which share each joint's torque moved, (joints)
  VecX<double> set(const VecX<double>& x, const std::vector<Term>& terms);

  /// The reference beside the causes so far. A delay is a share of the torque that the model
  /// predicts: it is as wrong as that torque.
  /// @return joints whose candidates have other columns now; empty: none
  std::vector<bool> rebase(const Projection& projection, const std::vector<Term>& terms);

  /// The base at parameters x and all causes that a model can hold.
  Model extended(const VecX<double>& x, const std::vector<Term>& terms) const;
  bool is_tilted() const { return tilted_; }

 private:
  bool set_tilt(const VecX<double>& x, const std::vector<Term>& terms);

  const Model& model_;
  const FitLayout& layout_;
  Evidence& train_;
  Evidence* test_;
  bool tilted_ = false;
  VecX<double> moved_;  ///< by joint, since its candidates' columns were made
};

}  // namespace diffnea
