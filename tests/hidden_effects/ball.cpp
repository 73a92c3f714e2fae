#include "ball.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <span>
#include <stdexcept>

#include "ball_evidence.hpp"
#include "case.hpp"
#include "sensors.hpp"

namespace hidden {
namespace {

constexpr double kBefore = 4.0;          // [s] that an elastic string needs to come to rest
constexpr double kAfter = 0.02;          // [s]
constexpr double kJointNoise = 1e-4;     // [rad]
constexpr long kJointEvery = 8;          // steps: 500 Hz
constexpr long kCameraEvery = 40;        // steps: 100 Hz
constexpr double kBallRadius = 0.02;     // [m]
constexpr double kViolent = 0.2;         // share of cases in which the string is slack at times
constexpr double kAbsorbedShare = 0.01;  // visible share below which nothing can be named
constexpr double kVisible = 30.0;        // as in score.py

struct BallCase {
  std::string family, kind, base = "refit";
  BallWorld world, nominal;
  std::string effect, where;  // empty: nothing is hidden
  double size = 0.0;          // over the effect's unit
  bool violent = false;
  double swing = 0.0;  // largest angle to the vertical that is aimed at [rad]
};

Eigen::Vector3d direction(Rng& rng) {
  const Eigen::Vector3d v{rng.normal(), rng.normal(), rng.normal()};
  return v.normalized();
}

BallCase draw_ball_case(const std::string& family, const BallOptions& o, Rng rng) {
  BallCase c;
  c.family = family;
  c.violent = rng.chance(kViolent);
  c.swing = rng.uniform(20.0, 40.0) * std::numbers::pi / 180.0;
  c.world.length = rng.uniform(0.33, 0.45);
  c.world.attachment = rng.uniform(0.0, 0.01) * direction(rng);
  c.nominal = c.world;
  c.nominal.length += rng.uniform(-0.02, 0.02);
  c.nominal.attachment += rng.uniform(0.0, 0.02) * direction(rng);
  c.kind = family == "ball_none" ? "none" : "named";
  for (const BallEffect& e : ball_effects(c.world)) {
    if ("ball_" + e.name != family) continue;
    c.effect = e.name;
    c.where = e.where;
    c.size = rng.log_uniform(o.smallest, o.largest);
    const Eigen::Vector3d way = direction(rng);
    const double sign = e.signs ? rng.sign() : 1.0;
    for (std::size_t k = 0; k < e.parameters.size(); ++k)
      e.parameters[k].at(c.world) =
          c.size * e.unit * (e.parameters.size() == 1 ? sign : way[static_cast<Eigen::Index>(k)]);
  }
  if (c.effect == "attachment_offset") {
    c.base = "fixed";
    c.nominal.length = c.world.length;
    c.nominal.attachment = c.world.attachment;
  }
  return c;
}

/// Index of the recording's first step.
std::size_t recorded() { return static_cast<std::size_t>(std::lround(kBefore / kSwingStep)); }

double largest_angle(const BallWorld& w, const BallRun& run) {
  double out = 0.0;
  for (std::size_t i = recorded(); i < run.path.size(); ++i) {
    const Eigen::Vector3d d =
        run.path[i].x - anchor(run.hand[2 * i], w.attachment + w.attachment_off).x;
    out = std::max(out, std::atan2(std::hypot(d.x(), d.y()), -d.z()));
  }
  return out;
}

std::span<const double> recorded_pull(const BallRun& run) {
  return std::span(run.pull).subspan(recorded());
}

double slack_share(const BallRun& run) {
  const auto pull = recorded_pull(run);
  return static_cast<double>(std::ranges::count(pull, 0.0)) / static_cast<double>(pull.size());
}

/// From hanging at rest under the hand, kBefore before the recording.
BallRun swing_run(const BallWorld& w, const ArmMotion& motion, double duration, long first_row) {
  BallRun run;
  const long steps = std::lround((kBefore + duration + kAfter) / kSwingStep);
  run.hand = hands(motion, -kBefore, kSwingStep / 2.0, 2 * steps + 1);
  const Eigen::Vector3d tied = w.attachment + w.attachment_off;
  const Anchor s = anchor(run.hand[0], tied);
  run.path = swing(w, run.hand.data(), steps, {s.x - w.length * Eigen::Vector3d::UnitZ(), s.v});
  for (std::size_t i = 0; i < run.path.size(); ++i)
    run.pull.push_back(tension(w, anchor(run.hand[2 * i], tied), run.path[i]));
  run.every = kCameraEvery;
  run.first = static_cast<long>(recorded()) + first_row * kJointEvery;
  run.rows = std::lround(duration / kSwingStep) / kCameraEvery;
  return run;
}

/// As vigorous as the case wants it: the swing of a given angle with the string always taut, or a
/// motion that lets it go slack.
BallRun wanted_run(const BallCase& c, ArmMotion& motion, double duration, long first_row) {
  const auto enough = [&](const BallRun& run) {
    if (c.violent) return slack_share(run) > 0.01;
    const double least = *std::ranges::min_element(recorded_pull(run));
    return largest_angle(c.world, run) > c.swing || least < 0.3 * c.world.mass * kGravity;
  };
  double low = 0.0, high = 0.5;
  const auto run_at = [&](double vigour) {
    motion.vigour = vigour;
    return swing_run(c.world, motion, duration, first_row);
  };
  while (high < 40.0 && !enough(run_at(high))) {
    low = high;
    high *= 1.8;
  }
  for (int i = 0; i < 3; ++i) {
    const double middle = 0.5 * (low + high);
    (enough(run_at(middle)) ? high : low) = middle;
  }
  return run_at(c.violent ? high : low);
}

Json list(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

Json model_json(const BallWorld& nominal) {
  Json links = Json::array();
  std::string parent;
  for (const ArmLink& link : arm_links()) {
    Json joint{{"type", link.joint.empty() ? "fixed" : "revolute"}};
    if (!link.joint.empty()) {
      joint["name"] = link.joint;
      joint["axis"] = {0, 0, 1};
    }
    joint["pose"] = {{"position", list(link.offset)}, {"rpy", list(link.rpy)}};
    // Nothing depends on them: the torques are not recorded.
    const Json inertia{{"mass", 2.0}, {"about_com", {0.02, 0, 0, 0.02, 0, 0.02}}};
    Json out{{"name", link.name}};
    if (!parent.empty()) out["parent"] = parent;
    out["joint"] = joint;
    out["inertia"] = inertia;
    links.push_back(out);
    parent = link.name;
  }
  return {{"schema", "diffnea/model/1"},
          {"name", "arm_with_ball"},
          {"gravity", {0, 0, -kGravity}},
          {"links", links},
          {"ball",
           {{"mass", nominal.mass},
            {"radius", kBallRadius},
            {"string",
             {{"link", parent},
              {"attachment", list(nominal.attachment)},
              {"length", nominal.length}}}}}};
}

void write_ball_recording(const std::filesystem::path& file, const BallCase& c,
                          const BallOptions& o, const ArmMotion& motion, const BallRun& run,
                          Rng rng) {
  std::string text = "time";
  for (const ArmLink& link : arm_links())
    if (!link.joint.empty()) text += ",q_" + link.joint;
  text += ",ball_x,ball_y,ball_z\n";
  const auto put = [&](double x) {
    char cell[32];
    std::snprintf(cell, sizeof cell, ",%.9g", x);
    text += cell;
  };
  for (long k = 0; k < std::lround(o.duration / kSwingStep) / kJointEvery; ++k) {
    const long step = static_cast<long>(recorded()) + k * kJointEvery;
    const double time = static_cast<double>(k * kJointEvery) * kSwingStep;
    char start[32];
    std::snprintf(start, sizeof start, "%.6f", time);
    text += start;
    for (int j = 0; j < kArmJoints; ++j) put(motion.joint(j, time).q + kJointNoise * rng.normal());
    if (step >= run.first && (step - run.first) % run.every == 0) {
      const Eigen::Vector3d x = seen(c.world, run.path, static_cast<double>(step));
      for (int i = 0; i < 3; ++i) put(x[i] + o.camera_noise * rng.normal());
    } else {
      text += ",,,";
    }
    text += "\n";
  }
  write_text(file, text);
}

Json ball_truth(std::uint64_t seed, BallCase& c, const BallOptions& o, const BallRun& train) {
  Json effects = Json::array();
  if (!c.effect.empty()) {
    const BallEvidence e =
        ball_evidence(c.world, c.effect, c.base == "refit", o.camera_noise, train);
    if (e.visible_share < kAbsorbedShare && e.expected_lm < kVisible) c.kind = "absorbed";
    Json parameters, rivals = Json::array();
    for (const BallEffect& effect : ball_effects(c.world))
      if (effect.name == c.effect)
        for (const BallParameter& p : effect.parameters) parameters[p.name] = p.at(c.world);
    for (const BallRival& r : e.rivals)
      rivals.push_back({{"effects", {r.effect}}, {"lm_beyond", r.lm_beyond}});
    effects.push_back({{"effect", c.effect},
                       {"where", c.where},
                       {"parameters", parameters},
                       {"size", c.size},
                       {"raw_lm", e.raw_lm},
                       {"expected_lm", e.expected_lm},
                       {"reachable_lm", e.expected_lm},
                       {"visible_share", e.visible_share},
                       {"variables", Json::array()},
                       {"rivals", rivals}});
  }
  return {{"schema", "diffnea/hidden_effects/truth/1"},
          {"seed", seed},
          {"family", c.family},
          {"kind", c.kind},
          {"base", c.base},
          {"robot", "arm_with_ball"},
          {"effects", effects},
          {"string", {{"length", c.world.length}, {"attachment", list(c.world.attachment)}}},
          {"recording",
           {{"duration", o.duration},
            {"rate", 1.0 / (kSwingStep * kJointEvery)},
            {"camera_rate", 1.0 / (kSwingStep * kCameraEvery)},
            {"position_noise", kJointNoise},
            {"camera_noise", o.camera_noise},
            {"largest_angle", largest_angle(c.world, train)},
            {"slack_share", slack_share(train)}}}};
}

}  // namespace

std::vector<std::string> ball_families() {
  std::vector<std::string> out{"ball_none"};
  for (const BallEffect& e : ball_effects({})) out.push_back("ball_" + e.name);
  return out;
}

void generate_ball(std::uint64_t seed, const std::string& family, const BallOptions& o,
                   const std::filesystem::path& folder) {
  const std::vector<std::string> all = ball_families();
  const auto at = std::ranges::find(all, family);
  if (at == all.end()) {
    std::string names;
    for (const std::string& f : all) names += (names.empty() ? "" : ", ") + f;
    throw std::invalid_argument("no family '" + family + "'; of the ball there are " + names);
  }
  // Streams of its own, beside those of the other families.
  const std::uint64_t stream = 100000 + 100 * static_cast<std::uint64_t>(at - all.begin());
  BallCase c = draw_ball_case(family, o, Rng(seed, stream + kDraw));
  const std::filesystem::path seen = folder / "seen", truth = folder / "truth";
  std::filesystem::create_directories(seen);
  std::filesystem::create_directories(truth);
  write_text(seen / "model.json", model_json(c.nominal).dump(1) + "\n");
  const double swing_hz = std::sqrt(kGravity / c.world.length) / (2.0 * std::numbers::pi);
  for (const bool is_test : {false, true}) {
    Rng noise(seed, stream + (is_test ? kTestNoise : kTrainNoise));
    ArmMotion motion(Rng(seed, stream + (is_test ? kTestMotion : kTrainMotion)), swing_hz);
    const BallRun run = wanted_run(c, motion, o.duration,
                                   noise.below(static_cast<int>(kCameraEvery / kJointEvery)));
    write_ball_recording(seen / (is_test ? "test.csv" : "train.csv"), c, o, motion, run, noise);
    if (!is_test) write_text(truth / "truth.json", ball_truth(seed, c, o, run).dump(1) + "\n");
  }
}

}  // namespace hidden
