#include "report/follows_words.hpp"

#include <algorithm>
#include <cmath>

#include "report/diagnose_words.hpp"
#include "report/format.hpp"

namespace diffnea::report {
namespace {

constexpr std::size_t kListed = 3;  ///< windows that are named

/// "4.1", "113"
std::string rounded(double x) { return number(x, x < 100.0 ? 2 : 3); }

/// "4.1 to 19 mrad and 2 mm"
std::string tolerances(const std::vector<SimulatedSeries>& joints) {
  std::string out;
  for (const char* unit : {"rad", "m"}) {
    double low = INFINITY, high = 0.0;
    for (const SimulatedSeries& s : joints)
      if (s.unit == unit) {
        low = std::min(low, s.tolerance);
        high = std::max(high, s.tolerance);
      }
    if (!(high > 0.0)) continue;
    const std::string least = rounded(1e3 * low), most = rounded(1e3 * high);
    out +=
        (out.empty() ? "" : " and ") + (least == most ? "" : least + " to ") + most + " m" + unit;
  }
  return out;
}

/// "within 5 mrad", "within 1 % of each joint's motion (4.1 to 19 mrad)"
std::string within(const std::vector<SimulatedSeries>& joints) {
  if (joints.size() == 1) return "within " + tolerances(joints);
  const auto of_noise = std::ranges::count_if(joints, is_of_noise);
  const std::string what = of_noise == 0 ? "1 % of each joint's motion"
                           : of_noise == std::ssize(joints)
                               ? "three times the sensors' noise"
                               : "1 % of each joint's motion, or three times its sensor's noise";
  return "within " + what + " (" + tolerances(joints) + ")";
}

/// "0.66 mrad", "1.2 to 7 mrad": of the joints' root mean square errors, those of one unit.
std::string errors(const Finding& f, double JointGain::* of) {
  double low = INFINITY, high = 0.0;
  for (const JointGain& j : f.joints)
    if (j.unit == f.joints.front().unit) {
      low = std::min(low, j.*of);
      high = std::max(high, j.*of);
    }
  const std::string least = number(1e3 * low, 2), most = number(1e3 * high, 2);
  return (least == most ? "" : least + " to ") + most + " m" + f.joints.front().unit;
}

/// A loop holds every simulation together: what counts is how far it is off.
std::string off_sentence(const Finding& f, const std::string& with) {
  const std::string over = in_seconds(f.simulated.horizons.back().horizon);
  std::string out = "Over " + over + " your simulation is off by ";
  if (!f.drives.empty() && std::isfinite(f.joints.front().described))
    out += errors(f, &JointGain::described) + "; with its drives fitted to the log, by ";
  out += errors(f, &JointGain::base);
  if (!f.causes.empty()) out += "; " + with + ", by " + errors(f, &JointGain::extended);
  return out + " (root mean square, held out).";
}

std::string with_causes(const Finding& f) {
  if (std::ranges::all_of(f.causes, [](const Cause& c) { return c.effect == "residual"; }))
    return "with what was learned";
  return f.causes.size() == 1 ? "with this cause" : "with these causes";
}

}  // namespace

bool is_of_noise(const SimulatedSeries& s) { return !(s.tolerance > 3.001 * s.noise); }

std::string in_seconds(double t) { return rounded(t) + " s"; }

std::string followed(const SimulatedMotion& m, double t) {
  return (t < m.horizons.back().horizon ? "" : "at least ") + in_seconds(t);
}

std::string follows_sentence(const Finding& f) {
  const SimulatedMotion& m = f.simulated;
  const bool of_joints =
      std::ranges::any_of(f.joints, [](const JointGain& j) { return !is_ball(j); });
  if (!m.reason.empty())
    return of_joints
               ? "For how long your simulation follows the robot is not known: " + m.reason + "."
               : "";
  if (m.horizons.empty() || m.joints.empty() || std::isnan(m.base_follows)) return "";
  const std::string shortest = in_seconds(m.horizons.front().horizon);
  const double before = m.base_follows, after = m.extended_follows;
  if (follows_commands(f)) return off_sentence(f, with_causes(f));
  std::string out = before > 0.0 ? "Your simulation follows the robot for " + followed(m, before) +
                                       " " + within(m.joints)
                                 : "Your simulation does not follow the robot for even " +
                                       shortest + " " + within(m.joints);
  if (f.causes.empty()) return out + ".";
  const std::string with = "; " + with_causes(f);
  if (before > 0.0)
    out += after > 0.0 ? with + ", for " + followed(m, after) : with + ", not for even " + shortest;
  else
    out +=
        after > 0.0 ? with + " it does, for " + followed(m, after) : with + " it does not either";
  return out + ".";
}

std::string verdict_sentence(const Finding& f) {
  const std::string first = follows_sentence(f);
  return !first.empty() && f.sentence.starts_with(first + " ") ? f.sentence.substr(first.size() + 1)
                                                               : f.sentence;
}

std::string apart_sentence(const Finding& f) {
  const SimulatedMotion& m = f.simulated;
  std::string out;
  for (const char* model : {"base", "extended"}) {
    if (f.causes.empty() && std::string(model) == "extended") continue;
    std::vector<const ApartWindow*> of;
    for (const ApartWindow& a : m.apart)
      if (a.model == model) of.push_back(&a);
    if (of.empty()) continue;
    const auto h = std::ranges::find(m.horizons, of.front()->horizon, &SimulatedHorizon::horizon);
    out += out.empty() ? "Simulations fall apart: " : "; ";
    out += std::string("with the ") + model + " model from windows of " +
           in_seconds(of.front()->horizon) + " on, " + std::to_string(of.size()) +
           (h == m.horizons.end() ? "" : " of " + std::to_string(h->windows)) + ": ";
    for (std::size_t k = 0; k < std::min(of.size(), kListed); ++k)
      out += (k == 0 ? "" : ", ") + of[k]->joint + " at " + number(of[k]->time, 4) + " s" +
             (of[k]->run > 0 ? " of run " + std::to_string(of[k]->run) : "");
    if (of.size() > kListed) out += " and " + std::to_string(of.size() - kListed) + " more";
  }
  return out.empty() ? "" : out + ".";
}

}  // namespace diffnea::report
