#include "robot.hpp"

#include <cstdio>
#include <stdexcept>

namespace hidden {
namespace {

std::string number(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.17g", x);
  return text;
}

template <std::size_t N>
std::string numbers(const std::array<double, N>& v) {
  std::string out;
  for (const double x : v) out += (out.empty() ? "" : " ") + number(x);
  return out;
}

std::array<double, 4> small_turn(Rng& rng, double angle) {
  Vec3 v{rng.normal(), rng.normal(), rng.normal()};
  const double length = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  const double s = std::sin(angle / 2.0) / length;
  return {std::cos(angle / 2.0), s * v[0], s * v[1], s * v[2]};
}

/// A limb of the given length along z: a box whose centre of mass is a bit off its middle.
Link limb(const std::string& joint, Vec3 axis, Vec3 pos, double mass, double length, Rng& rng) {
  Link link;
  link.joint = joint;
  link.axis = axis;
  link.pos = pos;
  link.mass = mass * rng.uniform(0.8, 1.25);
  const double width = rng.uniform(0.06, 0.14);
  link.com = {rng.uniform(-0.2, 0.2) * width, rng.uniform(-0.2, 0.2) * width,
              length * rng.uniform(0.35, 0.6)};
  link.size = {width, width * rng.uniform(0.7, 1.3), length * rng.uniform(0.8, 1.1)};
  link.turn = small_turn(rng, rng.uniform(0.0, 0.15));
  return link;
}

void set_range(Robot& robot, const std::vector<std::pair<double, double>>& centre_and_range) {
  for (std::size_t j = 0; j < robot.links.size(); ++j) {
    robot.links[j].centre = centre_and_range[j].first;
    robot.links[j].range = centre_and_range[j].second;
  }
}

Robot planar2(Rng& rng) {
  Robot r;
  const double l1 = rng.uniform(0.3, 0.6), l2 = rng.uniform(0.25, 0.5);
  r.links = {limb("shoulder", {0, 1, 0}, {0, 0, 0}, 4.0, l1, rng),
             limb("elbow", {0, 1, 0}, {0, 0, l1}, 2.0, l2, rng)};
  // In the plane, what turns out of it is not seen.
  for (Link& link : r.links) link.turn = {1, 0, 0, 0};
  r.tip = {0, 0, l2};
  set_range(r, {{rng.uniform(0.8, 1.6), 1.2}, {rng.uniform(-0.6, 0.6), 1.5}});
  return r;
}

Robot arm4(Rng& rng) {
  Robot r;
  const double upper = rng.uniform(0.45, 0.6), fore = rng.uniform(0.3, 0.4);
  r.links = {limb("joint1", {0, 0, 1}, {0, 0, 0.3}, 9.0, 0.15, rng),
             limb("joint2", {0, 1, 0}, {0, 0, 0.15}, 4.5, 0.25, rng),
             limb("joint3", {0, 0, 1}, {0, 0, 0.25}, 2.5, upper - 0.2, rng),
             limb("joint4", {0, 1, 0}, {0.045, 0, upper - 0.25}, 1.6, fore, rng)};
  r.tip = {0, 0, fore};
  r.first_is_vertical = true;
  set_range(r,
            {{0.0, 1.2}, {rng.uniform(0.5, 0.9), 1.0}, {0.0, 1.4}, {rng.uniform(0.8, 1.4), 1.1}});
  return r;
}

Robot slider(Rng& rng) {
  Robot r;
  Link carriage = limb("carriage", {1, 0, 0}, {0, 0, 0}, rng.uniform(8.0, 80.0), 0.2, rng);
  carriage.slide = true;
  r.links = {carriage};
  set_range(r, {{0.0, rng.uniform(0.1, 0.25)}});
  return r;
}

Robot arm6(Rng& rng) {
  Robot r;
  const double upper = rng.uniform(0.35, 0.6), fore = rng.uniform(0.3, 0.5);
  r.links = {limb("base_yaw", {0, 0, 1}, {0, 0, 0.2}, 7.0, 0.2, rng),
             limb("shoulder", {0, 1, 0}, {0.05, 0, 0.2}, 8.0, upper, rng),
             limb("elbow", {0, 1, 0}, {0, 0, upper}, 4.0, fore * 0.6, rng),
             limb("wrist_roll", {0, 0, 1}, {0.02, 0, fore * 0.6}, 2.5, fore * 0.4, rng),
             limb("wrist_pitch", {0, 1, 0}, {0, 0, fore * 0.4}, 1.6, 0.15, rng),
             limb("flange", {0, 0, 1}, {0, 0, 0.1}, 1.0, 0.15, rng)};
  r.links.back().com[0] = rng.sign() * rng.uniform(0.02, 0.05);
  r.tip = {0, 0, 0.15};
  r.first_is_vertical = true;
  set_range(r, {{0.0, 1.3},
                {rng.uniform(0.2, 0.7), 0.8},
                {rng.uniform(0.6, 1.1), 0.9},
                {0.0, 1.5},
                {rng.uniform(-0.5, 0.5), 1.2},
                {0.0, 1.6}});
  return r;
}

Vec3 box_moments(double mass, const Vec3& s) {
  const double k = mass / 12.0;
  return {k * (s[1] * s[1] + s[2] * s[2]), k * (s[0] * s[0] + s[2] * s[2]),
          k * (s[0] * s[0] + s[1] * s[1])};
}

std::string inertial(double mass, const Vec3& com, const Vec3& size,
                     const std::array<double, 4>& turn) {
  return "<inertial pos=\"" + numbers(com) + "\" quat=\"" + numbers(turn) + "\" mass=\"" +
         number(mass) + "\" diaginertia=\"" + numbers(box_moments(mass, size)) + "\"/>";
}

std::string joint_element(const Link& link, const std::string& name) {
  return "<joint name=\"" + name + "\" type=\"" + (link.slide ? "slide" : "hinge") + "\" axis=\"" +
         numbers(link.axis) + "\"";
}

/// Nothing of the rotor's own mass shows: its inertia is the armature of its joint.
std::string rotor(const Robot& robot, int j) {
  const Link& link = robot.links[static_cast<std::size_t>(j)];
  const std::string name = motor_joint(robot, j);
  return "<body name=\"" + name + "\" pos=\"" + numbers(link.pos) +
         "\"><inertial pos=\"0 0 0\" mass=\"1e-6\" diaginertia=\"1e-9 1e-9 1e-9\"/>" +
         joint_element(link, name) + "/></body>\n";
}

}  // namespace

std::string motor_joint(const Robot& robot, int joint) {
  return "motor_" + robot.links[static_cast<std::size_t>(joint)].joint;
}

Robot draw_robot(const std::string& name, Rng& rng) {
  Robot r;
  if (name == "planar2")
    r = planar2(rng);
  else if (name == "arm4")
    r = arm4(rng);
  else if (name == "slider")
    r = slider(rng);
  else if (name == "arm6")
    r = arm6(rng);
  else
    throw std::invalid_argument("no robot '" + name + "'; there are planar2, arm4, slider, arm6");
  r.name = name;
  return r;
}

Robot nominal_of(const Robot& robot, Rng& rng) {
  Robot out = robot;
  for (Link& link : out.links) {
    link.mass *= rng.uniform(0.8, 1.2);
    for (int i = 0; i < 3; ++i) {
      link.com[i] += rng.uniform(-0.1, 0.1) * link.size[i];
      link.size[i] *= rng.uniform(0.85, 1.15);
    }
    for (double* declared : {&link.armature, &link.damping, &link.coulomb})
      *declared *= rng.uniform(0.6, 1.5);
  }
  return out;
}

std::string to_mjcf(const Robot& robot, const Additions& additions, bool declared_friction) {
  std::string out = "<mujoco model=\"" + robot.name + "\">\n<compiler angle=\"radian\"/>\n" +
                    "<option gravity=\"" + numbers(robot.gravity) +
                    "\" integrator=\"RK4\"/>\n<worldbody>\n";
  std::string motors;
  for (int j = 0; j < robot.num_joints(); ++j) {
    const Link& link = robot.links[static_cast<std::size_t>(j)];
    for (const int r : additions.rotors)
      if (r == j) out += rotor(robot, j);
    out += "<body name=\"link" + std::to_string(j + 1) + "\" pos=\"" + numbers(link.pos) + "\">";
    out += inertial(link.mass, link.com, link.size, link.turn);
    out += joint_element(link, link.joint);
    if (link.armature > 0.0) out += " armature=\"" + number(link.armature) + "\"";
    if (declared_friction && link.damping > 0.0) out += " damping=\"" + number(link.damping) + "\"";
    if (declared_friction && link.coulomb > 0.0)
      out += " frictionloss=\"" + number(link.coulomb) + "\"";
    out += "/>\n";
    motors += "<motor name=\"" + link.joint + "\" joint=\"" + link.joint + "\"/>\n";
  }
  for (const Additions::Payload& p : additions.payloads)
    out += "<body>" + inertial(p.mass, p.com, p.size, {1, 0, 0, 0}) + "</body>";
  out += "<site name=\"tip\" pos=\"" + numbers(robot.tip) + "\"/>";
  for (int j = 0; j < robot.num_joints(); ++j) out += "</body>";
  for (const std::string& shaft : additions.shafts)
    out +=
        "<body><inertial pos=\"0 0 0\" mass=\"1e-6\" diaginertia=\"1e-9 1e-9 1e-9\"/><joint "
        "name=\"" +
        shaft + "\" axis=\"0 0 1\"/></body>";
  out += "\n</worldbody>\n<actuator>\n" + motors + "</actuator>\n";
  if (!additions.tendons.empty()) {
    out += "<tendon>\n";
    for (const Additions::Tendon& t : additions.tendons) {
      out += "<fixed name=\"" + t.name + "\">";
      for (const auto& [joint, coefficient] : t.terms)
        out += "<joint joint=\"" + joint + "\" coef=\"" + number(coefficient) + "\"/>";
      out += "</fixed>\n";
    }
    out += "</tendon>\n";
  }
  return out + "</mujoco>\n";
}

}  // namespace hidden
