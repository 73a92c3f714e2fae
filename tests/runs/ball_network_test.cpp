/// Networks of a ball: the forward pass by hand, the file's refusals, and the simulator's lanes.

#include <cmath>

#include <catch2/catch_approx.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/dynamics/batch.hpp>
#include <diffnea/dynamics/kinematics.hpp>
#include <diffnea/effects/ball_network.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/runs/ball_network_file.hpp>
#include <diffnea/sim/model_simulator.hpp>

namespace ball_network_test {

using namespace diffnea;
using Catch::Approx;
using Catch::Matchers::ContainsSubstring;

namespace {

const std::string kWam = DIFFNEA_SOURCE_DIR "/models/wam4_ball_in_cup.xml";
constexpr std::size_t kRelativeX = 0, kUp = 15;  ///< where an input has x_B − p_L and e_z

DenseLayer layer(int inputs, int outputs) {
  return {inputs, outputs, std::vector<double>(static_cast<std::size_t>(inputs * outputs), 0.0),
          std::vector<double>(static_cast<std::size_t>(outputs), 0.0)};
}
double& weight(DenseLayer& l, int output, int input) {
  return l.weights[static_cast<std::size_t>(input * l.outputs + output)];
}

/// No scaling, no members.
BallNetwork plain() {
  BallNetwork out;
  out.input_mean.assign(kNetworkInputs, 0.0);
  out.input_scale.assign(kNetworkInputs, 1.0);
  out.output_mean.assign(kNetworkOutputs, 0.0);
  out.output_scale.assign(kNetworkOutputs, 1.0);
  out.source = "test.json";
  return out;
}

/// a = −k (x_B − p_L) − g e_z: what a spring and gravity do, in L as in W.
BallNetwork spring(double k, double g) {
  DenseLayer l = layer(kNetworkInputs, 3);
  for (int i = 0; i < 3; ++i) {
    weight(l, i, int(kRelativeX) + i) = -k;
    weight(l, i, int(kUp) + i) = -g;
  }
  BallNetwork out = plain();
  out.members = {{{}, {l}}};
  return out;
}

/// Any LSTM with a head, of both sizes that blocks of eight do and do not divide.
BallNetwork random_lstm(unsigned seed) {
  Rng rng(seed);
  const auto filled = [&](int inputs, int outputs) {
    DenseLayer l = layer(inputs, outputs);
    for (double& w : l.weights) w = 0.3 * rng.normal();
    for (double& b : l.bias) b = 0.1 * rng.normal();
    return l;
  };
  BallNetwork out = plain();
  for (int member = 0; member < 2; ++member)
    out.members.push_back({{filled(kNetworkInputs + 5, 20), filled(5 + 3, 12)}, {filled(3, 3)}});
  out.warm_up = 0.1;
  return out;
}

const VecX<double> kHome = (VecX<double>(4) << 0.0, 0.6, 0.0, 1.25).finished();

/// What the simulator shows after `steps`, joint 4 of lane l driven by speed[l] [rad/s].
Lanes simulated(const BallNetwork& network, const std::string& instruction_set,
                const std::vector<double>& speed, int steps,
                std::vector<std::string>* failures = nullptr) {
  const Model model = read_model(kWam);
  ModelSimulatorOptions options;
  options.instruction_set = instruction_set;
  options.ball_network = std::make_shared<BallNetwork>(network);
  ModelSimulator world({model}, model, options);
  const long n = static_cast<long>(speed.size());
  world.reset({kHome.replicate(1, n), std::vector<std::uint64_t>(speed.size(), 0)});
  Lanes q = kHome.replicate(1, world.lanes()), qd = Lanes::Zero(4, world.lanes());
  for (int k = 0; k < steps; ++k) {
    for (long l = 0; l < n; ++l) {
      const double rate = speed[static_cast<std::size_t>(l)], t = k * world.period();
      q(3, l) = kHome[3] + 0.2 * std::sin(rate * t);
      qd(3, l) = 0.2 * rate * std::cos(rate * t);
    }
    world.step(q, qd);
  }
  if (failures) *failures = world.failures();
  return world.observe().leftCols(n);
}

long row_of(const std::string& channel) {
  const Model model = read_model(kWam);
  return find_channel(ModelSimulator({model}, model), channel);
}

}  // namespace

TEST_CASE("ball network: two layers and scaling, by hand", "[effects][ball_network]") {
  BallNetwork n = plain();
  n.input_mean[0] = 1.0;
  n.input_scale[0] = 2.0;
  n.output_mean[1] = 5.0;
  n.output_scale[1] = 10.0;
  DenseLayer first = layer(kNetworkInputs, 2), second = layer(2, 3);
  weight(first, 0, 0) = 0.5;
  weight(first, 1, 17) = -1.0;
  first.bias = {0.1, 0.2};
  weight(second, 1, 0) = 2.0;
  weight(second, 1, 1) = 3.0;
  second.bias = {7.0, 0.0, -7.0};
  n.members = {{{}, {first, second}}};
  check(n, "test");
  std::vector<double> x(kNetworkInputs, 0.0);
  x[0] = 4.0;
  x[17] = 0.3;
  NetworkEvaluator<double> evaluate(n);
  const Vec3<double> a = evaluate(x.data(), nullptr);
  CHECK(a.x == 7.0);
  // (4 − 1)/2 · 0.5 + 0.1 = 0.85; −0.3 + 0.2 = −0.1
  CHECK(a.y == Approx(5.0 + 10.0 * (2.0 * std::tanh(0.85) + 3.0 * std::tanh(-0.1))).epsilon(1e-14));
  CHECK(a.z == -7.0);
}

TEST_CASE("ball network: two steps of an LSTM cell, by hand", "[effects][ball_network]") {
  BallNetwork n = plain();
  DenseLayer cell = layer(kNetworkInputs + 1, 4), head = layer(1, 3);
  const double in[4] = {0.3, -0.2, 0.9, 0.5}, own[4] = {0.4, 0.6, -0.7, 0.1},
               bias[4] = {0.1, 1.0, 0.0, -0.3};
  for (int gate = 0; gate < 4; ++gate) {
    weight(cell, gate, 2) = in[gate];
    weight(cell, gate, kNetworkInputs) = own[gate];
    cell.bias[static_cast<std::size_t>(gate)] = bias[gate];
  }
  weight(head, 2, 0) = 1.0;
  n.members = {{{cell}, {head}}};
  check(n, "test");
  REQUIRE(num_hidden(n) == 2);
  std::vector<double> hidden(2, 0.0), x(kNetworkInputs, 0.0);
  NetworkEvaluator<double> evaluate(n);
  const auto sigmoid = [](double z) { return 1.0 / (1.0 + std::exp(-z)); };
  double h = 0.0, c = 0.0;
  for (const double seen : {0.8, -1.5}) {
    x[2] = seen;
    const auto gate = [&](int k) { return in[k] * seen + own[k] * h + bias[k]; };
    const double i = sigmoid(gate(0)), f = sigmoid(gate(1)), o = sigmoid(gate(3));
    c = f * c + i * std::tanh(gate(2));
    h = o * std::tanh(c);
    CHECK(evaluate(x.data(), hidden.data()).z == Approx(h).epsilon(1e-14));
  }
}

TEST_CASE("ball network: every instruction set moves the ball as double does",
          "[sim][ball_network]") {
  // tanh of a pack is to 4 units in the last place; 300 steps of a bounded network amplify little.
  constexpr double kTol = 1e-9;
  const BallNetwork network = random_lstm(3);
  const std::vector<double> speed{3.0, 7.0};
  const long ball = row_of("ball_x");
  Lanes first;
  for (const std::string& set : batch_instruction_sets()) {
    CAPTURE(set);
    const Lanes seen = simulated(network, set, speed, 300);
    if (first.size() == 0) first = seen;
    CHECK((seen - first).middleRows(ball, 6).cwiseAbs().maxCoeff() < kTol);
  }
  REQUIRE(first.size() > 0);
  CHECK((first.col(0) - first.col(1)).segment(ball, 3).norm() > 1e-3);  // the lanes do differ
  // Alone, a lane does what it does among others: its cells are its own.
  const Lanes alone = simulated(network, "", {speed[1]}, 300),
              together = simulated(network, "", speed, 300);
  CHECK((alone.col(0) - together.col(1)).cwiseAbs().maxCoeff() == 0.0);
}

TEST_CASE("ball network: the simulator integrates it, and leaves the arm alone",
          "[sim][ball_network]") {
  const double k = 30.0, g = 9.81;
  const int steps = 400;
  const long ball = row_of("ball_x");
  // The arm at rest: x'' = −k (x − p_L) − g e_z from r below the knot, p_L constant.
  const Lanes start = simulated(spring(k, g), "", {0.0}, 0);
  const Lanes seen = simulated(spring(k, g), "", {0.0}, steps);
  const Lanes other = simulated(spring(0.0, 0.0), "", {0.0}, steps);
  CHECK((seen - other).topRows(8).cwiseAbs().maxCoeff() == 0.0);            // q, q̇: nothing pulls
  CHECK((other - start).middleRows(ball, 6).cwiseAbs().maxCoeff() == 0.0);  // no gravity left
  CHECK(seen(row_of("phase"), 0) == double(BallPhase::kImagined));
  // About m = p_L − g/k e_z. Steps of h, x after v, turn the phase by 2 asin(½ √k h) each, and
  // begin half a step ahead.
  const double h = 0.002, angle = 2.0 * std::asin(0.5 * std::sqrt(k) * h);
  const double shape = std::cos(angle * (steps + 0.5)) / std::cos(0.5 * angle);
  LinkKinematics<double> links;
  forward_kinematics<double, double>(make_tree(read_model(kWam)), kHome, links);
  const Vec3<double> p_L = links.links[3].X_WL.p;
  const Eigen::Vector3d m(p_L.x, p_L.y, p_L.z - g / k), x0 = start.col(0).segment<3>(ball);
  const Eigen::Vector3d expected = m + (x0 - m) * shape;
  CHECK((seen.col(0).segment<3>(ball) - expected).norm() < 1e-9);
}

TEST_CASE("ball network: a ball that flies away fails its lane, and no other",
          "[sim][ball_network]") {
  const BallNetwork wild = spring(-400.0, 0.0);
  std::vector<std::string> failures;
  const Lanes seen = simulated(wild, "", {0.0, 5.0}, 1000, &failures);
  CHECK_THAT(failures[0], ContainsSubstring("flew away"));
  CHECK(seen.topRows(8).allFinite());
  CHECK(seen.middleRows(row_of("ball_x"), 3).allFinite());
  // One lane alone: the network answers a link that turns with a push.
  DenseLayer l = layer(kNetworkInputs, 3);
  weight(l, 0, 6) = weight(l, 0, 7) = weight(l, 0, 8) = 1e3;  // of ω_L
  BallNetwork pushed = plain();
  pushed.members = {{{}, {l}}};
  simulated(pushed, "", {0.0, 5.0}, 500, &failures);
  CHECK(failures[0].empty());
  CHECK_THAT(failures[1], ContainsSubstring("flew away"));
}

TEST_CASE("ball network: what does not fit is refused by name", "[io][ball_network]") {
  const auto document = [](const std::string& step, const std::string& layers,
                           const std::string& more = "") {
    std::string zeros, ones;
    for (int i = 0; i < 18; ++i) {
      zeros += i ? ",0" : "0";
      ones += i ? ",1" : "1";
    }
    return R"({"schema":"diffnea/ball-network/1","kind":"ff","step":)" + step +
           R"(,"warm_up":0,"input":{"mean":[)" + zeros + R"(],"scale":[)" + ones +
           R"(]},"output":{"mean":[0,0,0],"scale":[1,1,1]},"members":[{"cells":[],"layers":[)" +
           layers + "]}]" + more + "}";
  };
  std::string row = "[1";
  for (int i = 1; i < 18; ++i) row += ",0";
  row += "]";
  const std::string good = R"({"weights":[)" + row + "," + row + "," + row + R"(],"bias":[1,2,3]})";
  const auto error = [](const std::string& text) {
    try {
      ball_network_from_json(text, "net.json");
    } catch (const ModelError& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  REQUIRE(error(document("0.002", good)).empty());
  CHECK_THAT(error(document("0", good)), ContainsSubstring("net.json.step"));
  std::string endless = document("0.002", good);
  endless.replace(endless.find("\"warm_up\":0"), 11, "\"warm_up\":1e300");
  CHECK_THAT(error(endless), ContainsSubstring("net.json.warm_up"));
  CHECK_THAT(error(document("0.002", R"({"weights":[[1,2]],"bias":[0]})")),
             ContainsSubstring("takes 2 inputs, expected 18"));
  CHECK_THAT(error(document("0.002", R"({"weights":[)" + row + R"(],"bias":[0]})")),
             ContainsSubstring("gives 1 numbers, expected 3"));
  CHECK_THAT(error(document("0.002", R"({"weights":[)" + row + R"(],"bias":[0,1]})")),
             ContainsSubstring("one per output"));
  CHECK_THAT(error(document("0.002", good, R"(,"activation":"relu")")),
             ContainsSubstring("activation"));

  BallNetwork slow = spring(1.0, 1.0);
  slow.step = 0.01;
  CHECK_THROWS_WITH(simulated(slow, "", {0.0}, 1), ContainsSubstring("test.json.step") &&
                                                       ContainsSubstring("10 ms") &&
                                                       ContainsSubstring("2 ms"));
}

}  // namespace ball_network_test
