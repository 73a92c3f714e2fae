#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include <diffnea/core/error.hpp>
#include <diffnea/diagnose/diagnose.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/recording/audit.hpp>

#include "diagnose/evidence_plots.hpp"
#include "diagnose/next_experiment.hpp"
#include "diagnose/selection.hpp"
#include "diagnose/sentence.hpp"
#include "diagnose/simulated.hpp"
#include "diagnose/witness.hpp"

namespace diffnea {
namespace {

constexpr double kAbsorbedShare = 0.01;  ///< of a candidate's column that the base leaves
constexpr double kExplained = 0.8;       ///< below it, the cause is unknown

/// Where torques are compared, positions must not be attenuated: the order of their low-pass. (At
/// order 4, 14 % of an acceleration are missing at 0.8 of the cut-off, which looks like an elastic
/// joint.)
constexpr int kSteepFilter = 8;
constexpr double kLeastFilterHz = 5.0;

/// Stribeck's velocity over v₀, at least.
constexpr double kStribeckTurns = 3.0;

/// Of the blocks that are held out [s].
constexpr double kLeastBlock = 4.0;

/// How often the base's friction is read anew, and the change of ln v₀ that is worth it.
constexpr int kSmoothingPasses = 3;
constexpr double kSmoothingMove = 0.1;

/// Of the rows' Nyquist frequency: at half the RMS velocity, where most rows are.
constexpr double kRippleShare = 2.0;

/// A reference whose torque moves by less leaves the candidates' columns as they are.
constexpr double kMoved = 0.003;

IdentifyOptions reading_options(const DiagnoseOptions& options) {
  IdentifyOptions out;
  out.preprocess = options.preprocess;
  out.progress = options.progress;
  return out;
}

/// Rows of the inverse square root of a posterior's covariance, and a weak pull on what it says
/// nothing of.
BasePrior base_prior(Base base, const Model& model, const FitLayout& layout,
                     const std::vector<JointFactor>& factors) {
  BasePrior out;
  const long linear = static_cast<long>(layout.linear.size());
  const long smoothing = std::ranges::count_if(layout.shape, is_smoothing);
  out.x0 = VecX<double>::Zero(linear + smoothing);
  out.x0.head(linear) = layout.prior();
  if (base == Base::kFixed) {  // how sharply friction turns is no claim of the model
    for (long s = 0; s < smoothing; ++s) out.free.push_back(static_cast<int>(linear + s));
    out.root = MatX<double>::Identity(smoothing, smoothing);
    return out;
  }
  for (std::size_t k = 0; k < layout.linear.size(); ++k)
    if (!layout.linear[k].fixed) out.free.push_back(static_cast<int>(k));
  const double width = LinearFitOptions{}.prior_width;
  VecX<double> scale(linear + smoothing);
  scale << parameter_scales(layout, factors),
      VecX<double>::Constant(smoothing, 1.0 / width);  // a factor of e
  for (long s = 0; s < smoothing; ++s) out.free.push_back(static_cast<int>(linear + s));
  const long p = static_cast<long>(out.free.size());
  MatX<double> weak = MatX<double>::Zero(p, p);
  for (long k = 0; k < p; ++k)
    weak(k, k) = 1.0 / (width * scale[out.free[static_cast<std::size_t>(k)]]);
  if (base != Base::kPrior) {
    out.root = weak;
    return out;
  }
  const Posterior& posterior = *model.posterior;
  const long n = static_cast<long>(posterior.names.size());
  const MatX<double> information =
      Eigen::Map<const MatX<double>>(posterior.information.data(), n, n);
  const Eigen::SelfAdjointEigenSolver<MatX<double>> eigen(information);
  MatX<double> root(n, p);
  root.setZero();
  const MatX<double> L =
      eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal() * eigen.eigenvectors().transpose();
  for (long i = 0; i < n; ++i)
    for (long k = 0; k < p; ++k)
      if (out.free[static_cast<std::size_t>(k)] < linear &&
          layout.linear[static_cast<std::size_t>(out.free[static_cast<std::size_t>(k)])].name ==
              posterior.names[static_cast<std::size_t>(i)])
        root.col(k) = L.col(i);
  out.root.resize(n + p, p);
  out.root << root, weak;
  return out;
}

/// Every other tenth of the time is held out, a second apart from what is fitted.
void split_in_time(const Evidence& evidence, std::vector<bool>& fitted, std::vector<bool>& held) {
  fitted.assign(static_cast<std::size_t>(evidence.rows()), false);
  held = fitted;
  const long m = evidence.times(),
             block = std::max<long>(m / 10, std::lround(kLeastBlock / evidence.step()));
  if (m < 2 * block)
    throw DataError(
        "diagnose: " + format_number(static_cast<double>(m) * evidence.step()) +
        " s, without the ends that the filter needs, are too short to hold blocks of time out; " +
        "record " + format_number(2.5 * kLeastBlock) + " s or more, or give --test");
  const long guard = std::lround(1.0 / evidence.step());
  for (long i = 0; i < m; ++i) {
    const long inside = std::min(i % block, block - 1 - i % block);
    if (inside < guard / 2) continue;
    std::vector<bool>& which = (i / block) % 2 == 0 ? fitted : held;
    for (std::size_t k = 0; k < evidence.joints().size(); ++k)
      which[k * static_cast<std::size_t>(m) + static_cast<std::size_t>(i)] = true;
  }
}

/// The base parameters that go with the causes, physically consistent where all of them may move.
VecX<double> final_base(Base base, const FitLayout& layout, const Search& search,
                        const Evidence& evidence, const std::vector<Term>& terms, LinearFit& fit) {
  VecX<double> effects = VecX<double>::Zero(evidence.rows());
  for (const Term& t : terms) effects += t.torque();
  VecX<double> x = search.projection().parameters(effects);
  if (base != Base::kRefit) return x;
  const long p = static_cast<long>(layout.linear.size()), smoothing = x.size() - p;
  MatX<double> all(evidence.rows(), p + 1);
  all << evidence.base().leftCols(p),
      evidence.torque() - effects - evidence.base().rightCols(smoothing) * x.tail(smoothing);
  const MatX<double> rows = search.whitener()(all);
  std::vector<JointFactor> factors;
  std::size_t known = 0;
  for (int j = 0; j < evidence.num_dofs(); ++j) {
    std::vector<int> columns = evidence.factors()[static_cast<std::size_t>(j)].columns;
    std::erase_if(columns, [&](int c) { return c >= p; });
    factors.push_back({columns, TriangularFactor(static_cast<int>(columns.size()))});
    if (known >= evidence.joints().size() || evidence.joints()[known] != j) continue;
    const long begin = static_cast<long>(known++) * evidence.times();
    std::vector<long> used;
    for (long i = begin; i < begin + evidence.times(); ++i)
      if (search.whitener().kept()[static_cast<std::size_t>(i)]) used.push_back(i);
    RowMatX<double> block(static_cast<long>(used.size()), static_cast<long>(columns.size()) + 1);
    for (std::size_t c = 0; c < columns.size(); ++c)
      block.col(static_cast<long>(c)) = rows.col(columns[c])(used);
    block.col(block.cols() - 1) = rows.col(p)(used);
    factors.back().factor.add(block);
  }
  fit = fit_linear(layout, factors);
  x.head(p) = fit.x;
  return x;
}

std::vector<std::string> units_of(const Model& model) {
  std::vector<std::string> out;
  for (const int l : moving_links(model))
    out.push_back(model.links[static_cast<std::size_t>(l)].type == ModelJoint::kPrismatic ? "N"
                                                                                          : "N*m");
  return out;
}

class Diagnosis {
 public:
  Diagnosis(const Model& model, const RecordingSource& train, const RecordingSource* test,
            const DiagnoseOptions& options)
      : model_(model), train_source_(train), test_source_(test), options_(options) {
    if (options.progress)
      options_.progress = [this, told = options.progress](const FitProgress& progress) {
        const bool go_on = told(progress);
        finding_.interrupted |= !go_on;
        return go_on;
      };
  }

  Finding run() {
    const auto start = std::chrono::steady_clock::now();
    prepare();
    select();
    describe();
    judge();
    plan_next();
    finding_.plots = evidence_plots(finding_);
    finding_.sentence = sentence(finding_);
    finding_.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return std::move(finding_);
  }

 private:
  void prepare() {
    base_ = options_.base != Base::kAuto ? options_.base
            : model_.posterior           ? Base::kPrior
                                         : Base::kRefit;
    if (base_ == Base::kPrior && !model_.posterior)
      throw ModelError(
          "--base prior: " + (model_.source.empty() ? "the model" : model_.source) +
          " has no posterior; give the model.json that `identify` wrote, or take --base refit");
    finding_.base = base_ == Base::kRefit ? "refit" : base_ == Base::kPrior ? "prior" : "fixed";
    FitChoice choice;
    choice.effects = std::vector<std::string>{};
    layout_ = layout_for(model_, train_source_, test_source_, choice, finding_.notes);
    const IdentifyOptions reading = reading_options(options_);
    const std::vector<Recording> sample = train_source_.sample();
    link_side_ = sample.front().info.torque_side == TorqueSide::kLink;
    const AuditReport report = audit(sample, {.joints = describe_joints(model_)});
    finding_.audit = report.faults;
    period_ = sample.front().info.period;
    if (period_ <= 0.0 && !report.periods.empty()) period_ = report.periods.front().seconds;
    candidates_ = make_candidates(model_, options_.effects, train_source_.runs(), link_side_);
    PreprocessOptions preprocess = options_.preprocess;
    preprocess.order = kSteepFilter;
    finding_.plan = plan_preprocess(sample, preprocess);
    if (const double hz = informative_hz(finding_.plan);
        preprocess.filter_hz == 0.0 && hz < finding_.plan.filter_hz) {
      preprocess.filter_hz = hz;
      finding_.plan = plan_preprocess(sample, preprocess);
    }
    fit_rows_to_period(finding_.plan);
    // Beyond what the rows hold, positions bring noise alone, folded back by friction's turns.
    if (options_.preprocess.filter_hz == 0.0)
      finding_.plan.filter_hz = std::min(finding_.plan.filter_hz,
                                         0.5 / (finding_.plan.dt * finding_.plan.decimator.factor));
    finding_.data_report = train_source_.report();
    period_ = finding_.plan.dt * std::round(period_ / finding_.plan.dt);
    const auto read_train = [&] {
      train_ = std::make_unique<Evidence>(model_, layout_, train_source_, finding_.plan, period_,
                                          reading);
    };
    read_train();
    // The columns of friction are straight lines in ln v₀ about its first guess.
    for (int pass = 0; pass < kSmoothingPasses && turns_sharper(); ++pass) read_train();
    if (!train_->averaged()) period_ = 0.0;  // does not repeat well enough
    if (test_source_) {
      PreprocessOptions same = preprocess;
      same.filter_hz = finding_.plan.filter_hz;
      PreprocessPlan plan = plan_preprocess(test_source_->sample(), same);
      plan.decimator.factor = finding_.plan.decimator.factor;
      const std::vector<Recording> held = test_source_->sample();
      double period = held.front().info.period;
      if (period <= 0.0) period = detect_period(held.front()).seconds;
      if (period <= 0.0) period = period_;  // checked where it is used
      test_ = std::make_unique<Evidence>(model_, layout_, *test_source_, plan,
                                         plan.dt * std::round(period / plan.dt), reading,
                                         static_cast<int>(train_source_.runs().size()));
      test_plan_ = plan;
      finding_.held_out = "test recording";
    } else {
      split_in_time(*train_, fitted_rows_, held_rows_);
      finding_.held_out = "time blocks";
    }
    add_own_candidates(options_.candidates, model_, candidates_);
    for (const Candidate& c : candidates_)
      if (c.effect.own)
        for (Evidence* e : {train_.get(), test_.get()})
          if (e) e->evaluate(*c.effect.own);
    bound_shapes();
    prior_ = base_prior(base_, model_, layout_, linear_factors());
    const Whitener white(*train_, white_noise(*train_), fitted_rows_);
    set_reference(Projection(*train_, white, prior_).reference(VecX<double>::Zero(train_->rows())),
                  {});
    held_out_ = std::make_unique<HeldOut>(test_ ? *test_ : *train_, held_rows_, options_.seed);
    search_ = std::make_unique<Search>(*train_, candidates_, prior_, fitted_rows_);
    std::vector<Term> none;
    search_->refresh(period_, none);
  }

  /// Moves how sharply the base's friction turns to where the recording has it; whether that is
  /// far.
  bool turns_sharper() {
    const long p = static_cast<long>(layout_.linear.size());
    const long smoothing = std::ranges::count_if(layout_.shape, is_smoothing);
    if (smoothing == 0) return false;
    // Joints weighted by what the fit leaves of each; a factor of e is the prior's width.
    const VecX<double> x0 =
        base_ == Base::kRefit ? fit_linear(layout_, linear_factors()).x : layout_.prior();
    const std::vector<JointFactor>& factors = train_->factors();
    MatX<double> K = MatX<double>::Zero(p + smoothing, p + smoothing);
    VecX<double> k = VecX<double>::Zero(p + smoothing);
    for (const JointFactor& f : factors) {
      if (f.factor.rows() == 0) continue;
      const MatX<double> R = f.factor.R();
      VecX<double> d = f.factor.d();
      VecX<double> at(R.cols());
      for (long c = 0; c < R.cols(); ++c) {
        const int column = f.columns[static_cast<std::size_t>(c)];
        at[c] = column < p ? x0[column] : 0.0;
      }
      d -= R * at;
      const double left = d.squaredNorm() + f.factor.residual_sum_of_squares();
      const double weight = static_cast<double>(f.factor.rows()) / std::max(left, 1e-300);
      const MatX<double> RR = weight * (R.transpose() * R);
      const VecX<double> Rd = weight * (R.transpose() * d);
      for (long a = 0; a < R.cols(); ++a) {
        k[f.columns[static_cast<std::size_t>(a)]] += Rd[a];
        for (long b = 0; b < R.cols(); ++b)
          K(f.columns[static_cast<std::size_t>(a)], f.columns[static_cast<std::size_t>(b)]) +=
              RR(a, b);
      }
    }
    std::vector<int> free;
    for (long c = 0; c < p + smoothing; ++c)
      if (c >= p || (base_ != Base::kFixed && !layout_.linear[static_cast<std::size_t>(c)].fixed))
        free.push_back(static_cast<int>(c));
    MatX<double> A = K(free, free);
    const VecX<double> b = k(free);
    for (long c = 0; c < A.rows(); ++c)
      A(c, c) += free[static_cast<std::size_t>(c)] >= p ? 1.0 : 1e-9 * A(c, c) + 1e-300;
    const VecX<double> step = A.ldlt().solve(b).tail(smoothing);
    bool far = false;
    long at = 0;
    for (FitParameter& shape : layout_.shape) {
      if (!is_smoothing(shape)) continue;
      const double move = std::isfinite(step[at]) ? std::clamp(step[at], -1.0, 1.0) : 0.0;
      ++at;
      shape.prior *= std::exp(move);
      far = far || std::abs(move) > kSmoothingMove;
    }
    return far;
  }

  /// Factors of the linear parameters alone.
  std::vector<JointFactor> linear_factors() const {
    const int p = static_cast<int>(layout_.linear.size());
    std::vector<JointFactor> out;
    for (const JointFactor& f : train_->factors()) {
      std::vector<int> columns = f.columns;
      std::erase_if(columns, [&](int c) { return c >= p; });
      JointFactor kept{columns, TriangularFactor(static_cast<int>(columns.size()))};
      const long k = static_cast<long>(columns.size());  // they come first
      if (f.factor.rows() > 0) {
        RowMatX<double> rows = RowMatX<double>::Zero(f.factor.R().rows() + 1, k + 1);
        rows.topLeftCorner(rows.rows() - 1, k) = f.factor.R().leftCols(k);
        rows.col(k).head(rows.rows() - 1) = f.factor.d();
        rows(rows.rows() - 1, k) = std::sqrt(f.factor.residual_sum_of_squares());
        kept.factor.add(rows);
      }
      out.push_back(std::move(kept));
    }
    return out;
  }

  /// Where the positions' noise, as an acceleration of the joint's own inertia, becomes four times
  /// the torque's: beyond, rows tell little, and columns of accelerations are mostly noise. Median
  /// over the joints.
  double informative_hz(const PreprocessPlan& plan) const {
    const Tree<double> tree = make_tree(model_);
    MassMatrixWorkspace<double, double> ws;
    const MatX<double>& M =
        mass_matrix<double, double>(tree, VecX<double>::Zero(tree.num_dofs()), ws);
    std::vector<double> hz;
    for (int j = 0; j < tree.num_dofs(); ++j) {
      const std::size_t k = static_cast<std::size_t>(j);
      if (k >= plan.q_noise.size() || k >= plan.tau_noise.size() || !(plan.q_noise[k] > 0.0) ||
          !(plan.tau_noise[k] > 0.0) || !(M(j, j) > 0.0))
        continue;
      hz.push_back(std::sqrt(4.0 * plan.tau_noise[k] / (M(j, j) * plan.q_noise[k])) /
                   (2.0 * std::numbers::pi));
    }
    if (hz.empty()) return plan.filter_hz;
    std::ranges::nth_element(hz, hz.begin() + static_cast<long>(hz.size() / 2));
    return std::max(hz[hz.size() / 2], kLeastFilterHz);
  }

  /// Rows of a period must be a whole number, so that its repeats can be compared.
  void fit_rows_to_period(PreprocessPlan& plan) const {
    const long samples = std::lround(period_ / plan.dt);
    if (period_ <= 0.0 || samples < 1) return;
    for (int factor = plan.decimator.factor; factor > plan.decimator.factor / 2 && factor >= 1;
         --factor)
      if (samples % factor == 0) {
        plan.decimator.factor = factor;
        return;
      }
  }

  /// The base model at parameters x.
  Model base_at(const VecX<double>& x) const {
    const long linear = static_cast<long>(layout_.linear.size());
    VecX<double> shape(static_cast<long>(layout_.shape.size()));
    long at = linear;
    for (std::size_t s = 0; s < layout_.shape.size(); ++s) {
      shape[static_cast<long>(s)] = layout_.shape[s].prior;
      if (is_smoothing(layout_.shape[s]))
        shape[static_cast<long>(s)] *= std::exp(std::clamp(x[at++], -1.5, 1.5));
    }
    VecX<double> physical = x.head(linear);
    for (std::size_t k = 0; k < layout_.linear.size(); ++k)  // the test's base knows no bounds
      if (layout_.linear[k].sign != Sign::kFree && !layout_.linear[k].fixed)
        physical[static_cast<long>(k)] = std::max(physical[static_cast<long>(k)], 0.0);
    return apply_fit(model_, layout_, physical, shape);
  }

  /// The model whose torques effects refer to: base parameters x and the causes so far.
  /// @return by which share a joint's torque moved, the largest of all
  double set_reference(const VecX<double>& x, const std::vector<Term>& terms) {
    Model reference = base_at(x);
    finding_.model = reference;
    for (const Term& t : terms) {
      if (t.effect.own) continue;  // no model can hold it
      finding_.model.effects.push_back(to_spec(t.effect));
      // Those that change the tree or the channels are columns of their own on top of it.
      if (t.effect.is_local()) reference.effects.push_back(to_spec(t.effect));
    }
    const double moved = train_->set_reference(reference);
    if (test_) test_->set_reference(reference);
    return moved;
  }

  /// The reference beside the causes so far. A delay is a share of the torque that the model
  /// predicts: it is as wrong as that torque.
  bool rebase(const std::vector<Term>& terms) {
    VecX<double> effects = VecX<double>::Zero(train_->rows());
    for (const Term& t : terms) effects += t.torque();
    return set_reference(search_->projection().reference(effects), terms) > kMoved;
  }

  /// Shapes that the recording bounds.
  void bound_shapes() {
    std::vector<Candidate> kept;
    for (Candidate& c : candidates_) {
      const std::string& name = c.effect.info().name;
      const bool repeats = train_->averaged() && (!test_ || test_->averaged());
      // Columns of fourth derivatives and of the logged torque share the noise of what they are to
      // explain, unless both come from other periods.
      if (!repeats && (name == "saturation" || name == "joint_elasticity" || name == "backlash")) {
        const std::string reason = "not tried: needs a motion that repeats, two periods or more";
        if (std::ranges::none_of(finding_.refused,
                                 [&](const Refusal& r) { return r.effect == name; }))
          finding_.refused.push_back({name, "all", reason, 0.0});
        continue;
      }
      if (name == "saturation") bound_saturation(c);
      if (name == "cogging") bound_cogging(c);
      if (name == "stribeck_friction") bound_stribeck(c);
      if (!c.grid.empty()) kept.push_back(std::move(c));
    }
    candidates_ = std::move(kept);
  }

  /// A limit is met now and then: one below most of the torque would explain any torque by itself.
  void bound_saturation(Candidate& c) const {
    std::vector<double> size;
    for (const JointSeries& s : train_->series())
      for (long i = 0; i < s.rows(); ++i) size.push_back(std::abs(s.logged(i, c.effect.joints[0])));
    std::ranges::sort(size);
    const auto quantile = [&](double q) {
      return size[static_cast<std::size_t>(q * static_cast<double>(size.size() - 1))];
    };
    c.grid.clear();
    for (const double q : {0.999, 0.99, 0.97, 0.94, 0.9, 0.85, 0.8})
      c.grid.push_back({quantile(q)});
    c.shape_low = {quantile(0.75)};
  }

  /// Below a few v₀, Stribeck's curve only mends how friction turns.
  void bound_stribeck(Candidate& c) const {
    const auto value = [&](const char* name) {
      const auto at = std::ranges::find(c.effect.parameter_info, name, &ParameterInfo::name);
      return c.effect.parameters[static_cast<std::size_t>(at - c.effect.parameter_info.begin())];
    };
    double v0 = value("smoothing");
    for (const FitParameter& shape : layout_.shape)
      if (is_smoothing(shape) && shape.name.starts_with(c.effect.where + "."))
        v0 = std::max(v0, shape.prior);
    const double least = kStribeckTurns * v0;
    std::erase_if(c.grid, [&](const std::vector<double>& g) { return g[0] < least; });
    c.shape_low = {least};
    if (c.grid.empty()) c.grid = {{least}};
  }

  /// A ripple is one if the motion runs through it twice; below, it is any smooth function of the
  /// position. And at the joint's RMS velocity the rows must follow it; beyond, it is left of it
  /// what happens at reversals alone.
  void bound_cogging(Candidate& c) const {
    const int j = c.effect.joints[0];
    const VecX<double> q = train_->q().col(j);
    const double range = q.maxCoeff() - q.minCoeff(),
                 lowest = range > 0.0 ? 4.0 * std::numbers::pi / range : 1e300;
    const double speed =
        std::sqrt(train_->qd().col(j).squaredNorm() / static_cast<double>(train_->times()));
    const double highest =
        kRippleShare * std::numbers::pi / (train_->step() * std::max(speed, 1e-300));
    std::erase_if(c.grid,
                  [&](const std::vector<double>& g) { return g[0] < lowest || g[0] > highest; });
    c.shape_low = {lowest};
    c.shape_high = {std::max(highest, lowest)};
  }

  void select() {
    const int most =
        options_.max_causes > 0 ? options_.max_causes : std::max(8, 3 * layout_.num_dofs);
    Selection selection(*search_, candidates_, *held_out_,
                        {options_.accept_delta_bic, most, period_,
                         [this](const std::vector<Term>& terms) { return rebase(terms); }});
    first_scores_ = search_->scores({});
    terms_ = selection.run([this](const FitProgress& progress) {
      finding_.interrupted = options_.progress && !options_.progress(progress);
      return !finding_.interrupted;
    });
    if (static_cast<int>(terms_.size()) >= most)
      finding_.notes.push_back("stopped at " + std::to_string(most) +
                               " causes; the model may lack more");
    for (const Refusal& r :
         selection.refused()) {  // the last word on each that was not accepted after all
      const auto same = [&](const auto& other) {
        return other.effect == r.effect && other.where == r.where;
      };
      std::erase_if(finding_.refused, same);
      finding_.refused.push_back(r);
    }
    for (const Term& t : terms_)
      std::erase_if(finding_.refused, [&](const Refusal& r) {
        return r.effect == t.effect.info().name && r.where == t.effect.where;
      });
    if (!terms_.empty()) {
      finding_.causes = selection.causes(terms_);
    }
  }

  void describe() {
    for (const Score& s : first_scores_) {
      const Candidate& c = candidates_[static_cast<std::size_t>(s.candidate)];
      const std::string& name = c.effect.info().name;
      if (s.visible_share < kAbsorbedShare && s.visible_share > 0.0)
        finding_.absorbed.push_back({name, c.effect.where, s.visible_share});
      if (s.variant >= 0)
        finding_.candidates.push_back(
            {name, c.effect.where, s.delta_bic, s.gain, s.visible_share, {}});
    }
    for (const JointNoise& n : search_->whitener().noise()) finding_.noise.push_back(n.rms);
    // Is there anything to explain? The best of all candidates, as many times as there were trials.
    const double best = first_scores_.empty() || first_scores_.front().variant < 0
                            ? 0.0
                            : first_scores_.front().gain;
    finding_.lack_of_fit_p = std::min(1.0, static_cast<double>(first_scores_.size()) *
                                               std::erfc(std::sqrt(std::max(best, 0.0) / 2.0)));
    finding_.lack_of_fit =
        search_->residual_sum() /
        static_cast<double>(std::max<long>(search_->rows() - search_->projection().rank(), 1));

    const std::vector<std::string> names = joint_names(model_);
    const std::vector<WitnessScore> left =
        find_witnesses(*train_, *search_, terms_, *held_out_, names, options_.accept_delta_bic);
    for (const WitnessScore& w : left)
      finding_.witness.push_back(
          {names[static_cast<std::size_t>(w.joint)], w.variables, w.share, w.delta_bic});

    const VecX<double> e0 = held_out_->errors(*search_, {}),
                       e1 = held_out_->errors(*search_, terms_);
    const HeldOutChange change =
        held_out_->compare(held_out_->whitened(*search_, e0), held_out_->whitened(*search_, e1));
    double more = 0.0;  // that smooth functions of the motion would still remove
    for (const WitnessScore& w : left) more += std::max(0.0, w.held_out.before - w.held_out.after);
    finding_.gain = {std::sqrt(change.before),
                     std::sqrt(change.after),
                     std::sqrt(std::max(change.after - more, 0.0)),
                     change.before - change.after > 0.0
                         ? (change.before - change.after) / (change.before - change.after + more)
                         : 0.0,
                     change.low,
                     change.high};
    for (Cause& c : finding_.causes) c.gain.noise_floor = finding_.gain.noise_floor;
    add_series(e0, e1, more);

    LinearFit fit;
    const VecX<double> x = final_base(base_, layout_, *search_, *train_, terms_, fit);
    if (base_ == Base::kRefit) {
      VecX<double> shape(static_cast<long>(layout_.shape.size()));
      for (std::size_t k = 0; k < layout_.shape.size(); ++k)
        shape[static_cast<long>(k)] = layout_.shape[k].prior;
      finding_.parameters = parameter_estimates(layout_, fit.x, shape, fit.std, fit.identifiable,
                                                fit.solver.active_nonnegative);
    }
    set_reference(x, terms_);
    if (!finding_.interrupted) simulate(x);
  }

  /// @param x  the base parameters that go with the causes
  void simulate(const VecX<double>& x) {
    for (const Term& t : terms_)
      if (t.effect.own) {
        finding_.simulated.reason =
            "the extended model cannot hold the candidate " + t.effect.own->name;
        finding_.notes.push_back("the extended model lacks " + t.effect.own->name + " at " +
                                 t.effect.where +
                                 ": model files hold effects of the catalogue alone");
      }
    if (!finding_.simulated.reason.empty()) return;
    LinearFit fit;
    const VecX<double> alone =
        terms_.empty() ? x : final_base(base_, layout_, *search_, *train_, {}, fit);
    finding_.simulated =
        simulate_held_out(base_at(alone), finding_.model, test_ ? *test_source_ : train_source_,
                          held_out_->evidence(), held_rows_, test_ ? test_plan_ : finding_.plan,
                          reading_options(options_));
  }

  /// Only where something is left to tell apart: it takes a few seconds.
  void plan_next() {
    if (finding_.interrupted ||
        std::ranges::all_of(finding_.causes, [](const Cause& c) { return c.members.empty(); }))
      return;
    Model reference = finding_.model;
    reference.effects.resize(reference.effects.size() - terms_.size());  // the causes come last
    try {
      finding_.next_experiment =
          next_experiment({model_, reference, layout_, prior_, finding_.plan, train_->joints(),
                           search_->whitener().noise(), link_side_, candidates_, terms_,
                           finding_.causes, options_.seed});
    } catch (const Error& error) {
      finding_.notes.push_back(std::string("no next experiment is proposed: ") + error.what());
    }
  }

  void add_series(const VecX<double>& e0, const VecX<double>& e1, double) {
    const Evidence& e = held_out_->evidence();
    const std::vector<std::string> names = joint_names(model_), units = units_of(model_);
    for (std::size_t k = 0; k < e.joints().size(); ++k) {
      const int j = e.joints()[k];
      const long begin = static_cast<long>(k) * e.times();
      ResidualSeries s;
      s.joint = names[static_cast<std::size_t>(j)];
      s.unit = units[static_cast<std::size_t>(j)];
      JointGain g{s.joint, s.unit, 0.0, 0.0, 0.0, search_->whitener().noise()[k].rms};
      double rows = 0.0;
      for (long i = 0; i < e.times(); ++i) {
        const long row = begin + i;
        if (!held_rows_.empty() && !held_rows_[static_cast<std::size_t>(row)]) continue;
        s.time.push_back(e.time()[static_cast<std::size_t>(i)]);
        s.measured.push_back(e.torque()[row]);
        s.base.push_back(e.torque()[row] - e0[row]);
        s.extended.push_back(e.torque()[row] - e1[row]);
        s.q.push_back(e.q()(i, j));
        s.qd.push_back(e.qd()(i, j));
        s.qdd.push_back(e.qdd()(i, j));
        g.torque_rms += e.torque()[row] * e.torque()[row];
        g.base += e0[row] * e0[row];
        g.extended += e1[row] * e1[row];
        ++rows;
      }
      for (double* v : {&g.torque_rms, &g.base, &g.extended})
        *v = std::sqrt(*v / std::max(rows, 1.0));
      finding_.joints.push_back(g);
      finding_.series.push_back(std::move(s));
    }
  }

  void judge() {
    Finding& f = finding_;
    const bool ambiguous =
        std::ranges::any_of(f.causes, [](const Cause& c) { return c.verdict == Verdict::kClass; });
    if (!f.witness.empty() && f.gain.explained_share < kExplained)
      f.verdict = Verdict::kUnknown;
    else if (f.causes.empty())
      f.verdict = f.candidates.empty() ? Verdict::kNotIdentifiable : Verdict::kNone;
    else
      f.verdict = ambiguous ? Verdict::kClass : Verdict::kNamed;
  }

  const Model& model_;
  const RecordingSource& train_source_;
  const RecordingSource* test_source_;
  DiagnoseOptions options_;
  Finding finding_;
  Base base_ = Base::kRefit;
  FitLayout layout_;
  std::vector<Candidate> candidates_;
  double period_ = 0.0;
  PreprocessPlan test_plan_;
  bool link_side_ = false;
  std::vector<bool> fitted_rows_, held_rows_;
  BasePrior prior_;
  std::unique_ptr<Evidence> train_, test_;
  std::unique_ptr<HeldOut> held_out_;
  std::unique_ptr<Search> search_;
  std::vector<Score> first_scores_;
  std::vector<Term> terms_;
};

}  // namespace

const char* name_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::kNamed:
      return "NAMED";
    case Verdict::kClass:
      return "CLASS";
    case Verdict::kUnknown:
      return "UNKNOWN";
    case Verdict::kNone:
      return "NONE";
    case Verdict::kNotIdentifiable:
      return "NOT_IDENTIFIABLE";
  }
  return "";
}

Verdict verdict_from(const std::string& name) {
  for (const Verdict v : {Verdict::kNamed, Verdict::kClass, Verdict::kUnknown, Verdict::kNone,
                          Verdict::kNotIdentifiable})
    if (name == name_of(v)) return v;
  throw ModelError("verdict: got '" + name +
                   "'; choices: NAMED, CLASS, UNKNOWN, NONE, NOT_IDENTIFIABLE");
}

Finding diagnose(const Model& model, const RecordingSource& train, const RecordingSource* test,
                 const DiagnoseOptions& options) {
  if (test) refuse_same_recording(train, *test);
  return Diagnosis(model, train, test, options).run();
}

Finding diagnose(const Model& model, const std::vector<Recording>& train,
                 const std::vector<Recording>& test, const DiagnoseOptions& options) {
  const auto source = recordings_in_memory(model, train);
  std::unique_ptr<RecordingSource> held_out;
  if (!test.empty()) held_out = recordings_in_memory(model, test);
  return diagnose(model, *source, held_out.get(), options);
}

}  // namespace diffnea
