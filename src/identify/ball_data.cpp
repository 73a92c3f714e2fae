#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>
#include <diffnea/dynamics/cup_contact.hpp>
#include <diffnea/identify/ball_fit.hpp>

#include "core/decompositions.hpp"
#include "core/statistics.hpp"
#include "identify/ball_rows.hpp"

namespace diffnea {
namespace {

/// Surface of a ball over its way: struck balls reach 1 (table tennis) to 2.
constexpr double kMostSpin = 2.5;

/// A ball further from the origin is one in other units [m].
constexpr double kFarOnString = 20.0, kFarInFlight = 200.0;

/// @throws DataError if the positions cannot be metres
void require_metres(const Recording& r, bool string) {
  std::vector<double> distances;
  for (long k = 0; k < r.rows(); ++k)
    if (const double d = r.ball.row(k).norm(); std::isfinite(d)) distances.push_back(d);
  if (distances.empty()) return;
  const double middle = median(distances);
  if (middle > (string ? kFarOnString : kFarInFlight))
    throw DataError(r.source + ": the ball is " + detail::number_text(middle, 3) +
                    " m from the world's origin (median of ball_x, ball_y, ball_z), expected " +
                    detail::number_text(string ? kFarOnString : kFarInFlight, 3) +
                    " m at most; give its positions in metres, not in millimetres");
}

/// What touches the cup is no ball on a string [m]: a ball at 3 m/s moves this far while a picture
/// is 5 ms late.
constexpr double kTouching = 0.015;
/// After it the string may lie anywhere [s].
constexpr double kAfterTouch = 0.5;

/// Periods of the joints' filter after which the end of a recording is forgotten.
constexpr double kSettling = 0.75;

/// Position and velocity at the first row: the parabola of least squares through 0.1 s of rows.
ParticleState<double> first_state(const BallWindow& w) {
  long n = 0;
  while (n < static_cast<long>(w.time.size()) && (n < 5 || w.time[n] - w.time[0] <= 0.1)) ++n;
  const Parabola c = parabola(w.time, w.seen, 0, n, w.time[0]);
  return {c.x, c.v};
}

/// Cuts one recording into windows.
class Windows {
 public:
  Windows(const Recording& r, const Model& model, const BallFitOptions& options, BallData& data)
      : recording_(r),
        options_(options),
        data_(data),
        radius_(model.ball->radius),
        X_LC_(cup_at_string(model)),
        cup_(model.cup.value_or(CupSpec{})) {
    std::vector<double> time;
    std::vector<Vec3<double>> seen;
    for (long k = 0; k < r.rows(); ++k) {
      if (!r.ball.row(k).array().isFinite().all()) continue;
      rows_.push_back(k);
      time.push_back(r.time[k]);
      seen.push_back({r.ball(k, 0), r.ball(k, 1), r.ball(k, 2)});
    }
    const bool bounces = std::ranges::any_of(model.effects, [](const EffectSpec& e) {
      return find_effect(e.effect).port == Port::kBallImpact;
    });
    lost_ = find_outliers(time, seen, options.longest_gap);
    for (std::size_t i = 0; i < lost_.size(); ++i)
      if (lost_[i] > 0.0)
        flag(time[i], "ball",
             "is " + detail::number_text(1e3 * lost_[i], 3) + " mm off its neighbours");
    if (!model.ball->string && !bounces) kinks_ = find_kinks(time, seen, options.longest_gap);
    seen_ = std::move(seen);
  }

  /// The ends of a hand's motion, which filters have spoilt. [s]
  void keep_off(double margin) { margin_ = margin; }

  void add(int hand, const HandMotion& motion) {
    hand_ = hand;
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      const double t = recording_.time[rows_[i]];
      if (lost_[i] > 0.0 || !motion.covers(t - margin_, t + margin_)) continue;
      if (touches_cup(motion, t, seen_[i])) touched_ = t;
      if (t - touched_ < kAfterTouch) {
        ++data_.touching;
        continue;
      }
      if (!kinks_.empty() && kinks_[i]) {
        close();
        bounced_ = true;
        continue;
      }
      if (!window_.time.empty() && (t - window_.time.back() > options_.longest_gap ||
                                    t - window_.time.front() >= options_.window))
        close();
      window_.time.push_back(t);
      window_.seen.push_back(seen_[i]);
      if (recording_.spin.size() > 0 && recording_.spin.row(rows_[i]).array().isFinite().all()) {
        spin_sum_ =
            spin_sum_ + Vec3<double>{recording_.spin(rows_[i], 0), recording_.spin(rows_[i], 1),
                                     recording_.spin(rows_[i], 2)};
        ++spins_;
      }
    }
    close();
  }

 private:
  bool touches_cup(const HandMotion& motion, double t, const Vec3<double>& x) const {
    if (!X_LC_) return false;
    const Pose<double> X_WC = motion.pose(t) * *X_LC_;
    return distance_to_cup(cup_position(x, X_WC.p, X_WC.R.col[2]), cup_) < radius_ + kTouching;
  }
  void close() {
    BallWindow w = std::move(window_);
    window_ = {};
    const Vec3<double> spin_sum = spin_sum_;
    const long spins = spins_;
    spin_sum_ = {0, 0, 0};
    spins_ = 0;
    if (w.time.size() < 6 || w.time.back() - w.time.front() < options_.shortest) return;
    w.run = recording_.run;
    w.hand = hand_;
    w.state = first_state(w);
    if (recording_.spin.size() > 0) {
      const double from = w.time.front();
      if (bounced_) return flag(from, "spin", "a bounce has changed it, and the model has none");
      if (spins == 0) return flag(from, "spin", "is not recorded");
      w.spin = spin_sum * (1.0 / static_cast<double>(spins));
      const double spin = std::sqrt(dot(w.spin, w.spin)),
                   speed = std::sqrt(dot(w.state.v, w.state.v));
      if (radius_ * spin > kMostSpin * speed)
        return flag(from, "spin",
                    detail::number_text(spin, 3) + " rad/s would move the surface at " +
                        detail::number_text(radius_ * spin / speed, 3) +
                        " times the ball's speed, expected " + detail::number_text(kMostSpin, 3) +
                        " at most");
    }
    data_.windows.push_back(std::move(w));
  }
  void flag(double time, const std::string& channel, const std::string& reason) {
    data_.flagged.push_back({recording_.run, time, channel, reason});
  }

  const Recording& recording_;
  const BallFitOptions& options_;
  BallData& data_;
  double radius_, margin_ = 0.0;
  std::optional<Pose<double>> X_LC_;  ///< of the cup, where it moves with the string's end
  CupSpec cup_;
  double touched_ = -INFINITY;  ///< when the ball last did [s]
  std::vector<long> rows_;      ///< of the recording, at which the ball was seen
  std::vector<Vec3<double>> seen_;
  std::vector<double> lost_;  ///< how far a row that cannot be true is off [m]; 0: it may be
  std::vector<bool> kinks_;
  bool bounced_ = false;
  int hand_ = 0;
  BallWindow window_;
  Vec3<double> spin_sum_{0, 0, 0};
  long spins_ = 0;
};

}  // namespace

BallData make_ball_data(const Model& model, const std::vector<Recording>& recordings,
                        const BallFitOptions& options, const PreprocessOptions& smoothing) {
  BallData data;
  if (!recordings.empty()) data.source = recordings.front().source;
  const TreeMap map = map_to_tree(model);
  const int link = model.ball && model.ball->string ? model.ball->string->link : -1;
  const bool driven = link >= 0 && map.dof[static_cast<std::size_t>(link)] >= 0;
  for (const Recording& r : recordings) {
    if (r.ball.rows() != r.rows() || r.rows() == 0)
      throw DataError(r.source +
                      ": the ball was not recorded; expected columns ball_x, ball_y, "
                      "ball_z [m] in the world's frame");
    require_metres(r, link >= 0 || (model.ball && model.ball->string));
    Windows windows(r, model, options, data);
    const std::size_t before = data.windows.size(), flags = data.flagged.size();
    const auto add = [&] {
      windows.add(static_cast<int>(data.hands.size()) - 1, data.hands.back());
    };
    if (!driven) {
      const Pose<double> X_WL =
          link >= 0 ? map.X_LF[static_cast<std::size_t>(link)] : Pose<double>::identity();
      data.hands.emplace_back(X_WL);
      add();
    } else {
      const PreprocessPlan plan = plan_preprocess({r}, smoothing);
      const Preprocessed smooth = preprocess(r, plan);
      windows.keep_off(plan.filter_hz > 0.0 ? kSettling / plan.filter_hz : 0.0);
      for (long first = 0; first < smooth.rows();) {
        long end = first;
        while (end < smooth.rows() && smooth.segment[end] == smooth.segment[first]) ++end;
        data.hands.emplace_back(model, link, smooth, first, end - first);
        add();
        first = end;
      }
    }
    if (data.windows.size() == before && data.flagged.size() == flags)
      data.flagged.push_back({r.run, r.time[0], "ball",
                              "is nowhere seen for " + detail::number_text(options.shortest, 3) +
                                  " s on end (rows further apart than " +
                                  detail::number_text(options.longest_gap, 3) + " s are a gap)"});
  }
  if (data.windows.empty())
    throw DataError(recordings.front().source + ": the ball " +
                    (data.flagged.empty()
                         ? "is nowhere seen"
                         : data.flagged.back().channel + ": " + data.flagged.back().reason) +
                    "; no stretch of the recordings is left to fit");
  return data;
}

}  // namespace diffnea
