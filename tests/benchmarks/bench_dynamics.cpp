/// Time of the dynamics against MuJoCo, and Pinocchio where it was found: `make bench`.
/// Thread CPU time per call; all calls take turns in every round, and the table shows the median
/// round, so that a machine that slows down slows all of them.

#include <algorithm>
#include <array>
#include <cstdio>
#include <fstream>
#include <functional>
#include <initializer_list>
#include <memory>
#include <stdexcept>
#include <string>
#include <time.h>
#include <vector>

#include <diffnea/dynamics/aba.hpp>
#include <diffnea/dynamics/batch.hpp>
#include <diffnea/dynamics/derivatives.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/dynamics/regressor.hpp>
#include <diffnea/dynamics/rnea.hpp>

#ifdef DIFFNEA_HAS_PINOCCHIO
#include "benchmarks/pinocchio_peer.hpp"
#endif
#include "support/mujoco_tree.hpp"
#include "support/random_floating.hpp"

using namespace diffnea;
using namespace diffnea::test;

namespace {

constexpr int kJoints = 7, kStates = 64, kRounds = 31, kCallsPerRound = 2048, kBatch = 128;

struct Timed {
  std::string group, name;
  std::function<void(int state)> call;
  double states_per_call = 1.0;
  std::vector<double> rounds = {};  ///< [ns]

  double median() const {
    std::vector<double> sorted = rounds;
    std::ranges::sort(sorted);
    return sorted[sorted.size() / 2];
  }
};

double thread_seconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

void run_round(Timed& timed) {
  const int calls = std::max(1, static_cast<int>(kCallsPerRound / timed.states_per_call));
  const double begin = thread_seconds();
  for (int k = 0; k < calls; ++k) timed.call(k % kStates);
  timed.rounds.push_back((thread_seconds() - begin) * 1e9 / (calls * timed.states_per_call));
}

/// A robot on a free base, its limbs as chains of joints about z: one entry a limb, its joints.
struct Floating {
  Floating(Rng& rng, std::initializer_list<int> limbs) : tree(free_base_tree(random_inertia(rng))) {
    tree.gravity = {0, 0, -9.81};
    for (const int joints : limbs)
      for (int k = 0; k < joints; ++k)
        add_link(tree, {.parent = k == 0 ? 0 : tree.num_links() - 1,
                        .X_PJ = random_pose(rng),
                        .inertia = random_inertia(rng),
                        .armature = 0.1});
    for (int k = 0; k < kStates; ++k) {
      const int n = tree.num_velocities();
      q.push_back(random_positions(rng, tree));
      v.push_back(random_vector(rng, n));
      vd.push_back(random_vector(rng, n, 5.0));
      tau.push_back(random_vector(rng, n, 10.0));
    }
  }
  Tree<double> tree;
  std::vector<VecX<double>> q, v, vd, tau;
  RneaWorkspace<double, double> rnea_ws;
  AbaWorkspace<double, double> aba_ws;
};

#ifdef DIFFNEA_HAS_PINOCCHIO
PinocchioPeer peer_of(const Tree<double>& tree) {
  std::vector<PeerLink> links;
  for (const Link<double>& link : tree.links) {
    const Vec3<double> p = link.X_PJ.p, c = link.inertia.h * (1.0 / link.inertia.m);
    const Mat3<double> Rt = transpose(link.X_PJ.R), I = full(inertia_about_com(link.inertia));
    PeerLink peer{link.parent,     {}, {p.x, p.y, p.z}, link.inertia.m,
                  {c.x, c.y, c.z}, {}, link.armature};
    for (int k = 0; k < 3; ++k) {
      std::ranges::copy(std::array{Rt.col[k].x, Rt.col[k].y, Rt.col[k].z}, peer.R_PJ + 3 * k);
      std::ranges::copy(std::array{I.col[k].x, I.col[k].y, I.col[k].z}, peer.I_com + 3 * k);
    }
    links.push_back(peer);
  }
  return PinocchioPeer(links, tree.free_base);
}

/// Halves of the base's six numbers exchanged: Pinocchio has the linear one first.
VecX<double> linear_first(VecX<double> x) {
  x.head<3>().swap(x.segment<3>(3));
  return x;
}

/// A comparison of times means something if the numbers are the same.
void require_same(const VecX<double>& ours, const double* theirs) {
  const Eigen::Map<const VecX<double>> other(theirs, ours.size());
  if (!((ours - other).norm() < 1e-9 * other.norm()))
    throw std::runtime_error("the peer computes something else");
}
#endif

std::string processor() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);)
    if (line.starts_with("model name")) return line.substr(line.find(':') + 2);
  return "unknown processor";
}

}  // namespace

int main() {
  Rng rng(7);
  Tree<double> tree =
      random_tree(rng, {.num_dofs = kJoints, .branching = false, .prismatic = false});
  for (int i = 0; i < kJoints; ++i) tree.links[i].axis = {0, 0, 1};
  tree.gravity = {0, 0, -9.81};
  std::vector<VecX<double>> q, qd, qdd, tau;
  for (int k = 0; k < kStates; ++k) {
    q.push_back(random_vector(rng, kJoints, 1.5));
    qd.push_back(random_vector(rng, kJoints));
    qdd.push_back(random_vector(rng, kJoints, 5.0));
    tau.push_back(random_vector(rng, kJoints, 10.0));
  }

  std::vector<Timed> table;
  const auto add = [&](std::string group, std::string name, std::function<void(int)> call) {
    table.push_back({std::move(group), std::move(name), std::move(call)});
  };
  RneaWorkspace<double, double> rnea_ws;
  AbaWorkspace<double, double> aba_ws;
  MassMatrixWorkspace<double, double> mass_ws;
  RegressorWorkspace<double, double> regressor_ws;
  RneaDerivatives rnea_derivs;
  AbaDerivatives aba_derivs;
  ParameterJacobianWorkspace parameter_ws;
  add("RNEA", "diffnea", [&](int k) { rnea(tree, q[k], qd[k], qdd[k], rnea_ws); });
  add("ABA", "diffnea", [&](int k) { aba(tree, q[k], qd[k], tau[k], aba_ws); });
  add("mass matrix", "diffnea", [&](int k) { mass_matrix(tree, q[k], mass_ws); });
  add("RNEA derivatives", "diffnea",
      [&](int k) { rnea_derivatives(tree, q[k], qd[k], qdd[k], rnea_derivs); });
  add("ABA derivatives", "diffnea",
      [&](int k) { aba_derivatives(tree, q[k], qd[k], tau[k], aba_derivs); });
  add("torque regressor", "diffnea",
      [&](int k) { torque_regressor(tree, q[k], qd[k], qdd[k], regressor_ws); });
  add("70 d(qdd)/d(pi)", "diffnea",
      [&](int k) { forward_dynamics_parameter_jacobian(tree, q[k], qd[k], tau[k], parameter_ws); });

  const Mujoco mujoco(tree);
  mjModel* m = mujoco.model.get();
  mjData* d = mujoco.data.get();
  const auto set = [&](int k) {
    std::ranges::copy(q[k], d->qpos);
    std::ranges::copy(qd[k], d->qvel);
  };
  add("RNEA", "MuJoCo mj_inverse", [&](int k) {
    set(k);
    std::ranges::copy(qdd[k], d->qacc);
    mj_inverse(m, d);
  });
  add("ABA", "MuJoCo mj_forward", [&](int k) {
    set(k);
    std::ranges::copy(tau[k], d->qfrc_applied);
    mj_forward(m, d);
  });

  RowMatX<double> Q(kBatch, kJoints), Qd(kBatch, kJoints), Qdd(kBatch, kJoints),
      Tau(kBatch, kJoints);
  for (int k = 0; k < kBatch; ++k) {
    Q.row(k) = q[k % kStates];
    Qd.row(k) = qd[k % kStates];
    Qdd.row(k) = qdd[k % kStates];
    Tau.row(k) = tau[k % kStates];
  }
  RowMatX<double> Y;
  for (const std::string& isa : batch_instruction_sets()) {
    const BatchOptions options{.num_threads = 1, .instruction_set = isa};
    const auto add_batch = [&](std::string group, std::function<void()> call) {
      table.push_back(
          {std::move(group), "diffnea " + isa + ", a state", [call](int) { call(); }, kBatch});
    };
    add_batch("RNEA", [&, options] { rnea_batch(tree, Q, Qd, Qdd, options); });
    add_batch("ABA", [&, options] { aba_batch(tree, Q, Qd, Tau, options); });
    add_batch("torque regressor", [&, options] { regressor_batch(tree, Q, Qd, Qdd, Y, options); });
  }

#ifdef DIFFNEA_HAS_PINOCCHIO
  PinocchioPeer peer = peer_of(tree);
  const std::string by = std::string("Pinocchio ") + PinocchioPeer::version();
  for (int k = 0; k < kStates; ++k)
    require_same(aba(tree, q[k], qd[k], tau[k], aba_ws),
                 peer.aba(q[k].data(), qd[k].data(), tau[k].data()));
  add("RNEA", by, [&](int k) { peer.rnea(q[k].data(), qd[k].data(), qdd[k].data()); });
  add("ABA", by, [&](int k) { peer.aba(q[k].data(), qd[k].data(), tau[k].data()); });
  add("mass matrix", by, [&](int k) { peer.mass_matrix(q[k].data()); });
  add("RNEA derivatives", by,
      [&](int k) { peer.rnea_derivatives(q[k].data(), qd[k].data(), qdd[k].data()); });
  add("ABA derivatives", by,
      [&](int k) { peer.aba_derivatives(q[k].data(), qd[k].data(), tau[k].data()); });
  add("torque regressor", by,
      [&](int k) { peer.torque_regressor(q[k].data(), qd[k].data(), qdd[k].data()); });
#endif

  // Legs, arms, waist and head; and four legs.
  Floating humanoid(rng, {6, 6, 7, 7, 3, 1}), quadruped(rng, {3, 3, 3, 3});
  const std::pair<std::string, Floating*> floating[] = {{"humanoid, 6 + 30", &humanoid},
                                                        {"quadruped, 6 + 12", &quadruped}};
  for (const auto& [name, robot] : floating) {
    add("RNEA, " + name, "diffnea",
        [r = robot](int k) { rnea(r->tree, r->q[k], r->v[k], r->vd[k], r->rnea_ws); });
    add("ABA, " + name, "diffnea",
        [r = robot](int k) { aba(r->tree, r->q[k], r->v[k], r->tau[k], r->aba_ws); });
  }
#ifdef DIFFNEA_HAS_PINOCCHIO
  std::vector<std::shared_ptr<PinocchioPeer>> peers;
  std::vector<std::shared_ptr<Floating>> theirs;  // the same states in its order
  for (const auto& [name, robot] : floating) {
    peers.emplace_back(new PinocchioPeer(peer_of(robot->tree)));
    theirs.push_back(std::make_shared<Floating>(*robot));
    Floating& r = *theirs.back();
    PinocchioPeer& p = *peers.back();
    for (auto* list : {&r.v, &r.vd, &r.tau})
      for (VecX<double>& x : *list) x = linear_first(x);
    for (int k = 0; k < kStates; ++k) {
      require_same(
          linear_first(aba(robot->tree, robot->q[k], robot->v[k], robot->tau[k], robot->aba_ws)),
          p.aba(r.q[k].data(), r.v[k].data(), r.tau[k].data()));
      require_same(
          linear_first(rnea(robot->tree, robot->q[k], robot->v[k], robot->vd[k], robot->rnea_ws)),
          p.rnea(r.q[k].data(), r.v[k].data(), r.vd[k].data()));
    }
    add("RNEA, " + name, by,
        [&r, &p](int k) { p.rnea(r.q[k].data(), r.v[k].data(), r.vd[k].data()); });
    add("ABA, " + name, by,
        [&r, &p](int k) { p.aba(r.q[k].data(), r.v[k].data(), r.tau[k].data()); });
  }
#endif

  for (int round = 0; round < kRounds; ++round)
    for (Timed& timed : table) run_round(timed);

  std::printf(
      "%s; MuJoCo %s; %d joints; median of %d rounds, thread CPU time; ratio to diffnea's scalar "
      "call\n",
      processor().c_str(), mj_versionString(), kJoints, kRounds);
  std::printf("%-23s %-26s %10s %8s\n", "call", "by", "ns", "ratio");
  for (const Timed& ours : table) {
    if (ours.name != "diffnea") continue;
    for (const Timed& other : table)
      if (other.group == ours.group)
        std::printf("%-23s %-26s %10.0f %8.2f\n", other.group.c_str(), other.name.c_str(),
                    other.median(), other.median() / ours.median());
  }
}
