#include <algorithm>
#include <cmath>

#include "report/diagnose_sections.hpp"
#include "report/diagnose_words.hpp"
#include "report/follows_words.hpp"
#include "report/format.hpp"
#include "report/html.hpp"

namespace diffnea::report {
namespace {

constexpr std::size_t kOpen =
    2;  ///< joints whose motion is open: of causes, or that are left first

/// Indices of the joints: those of causes, in their order, then the others, those first that the
/// extended model leaves first.
std::vector<std::size_t> by_interest(const Finding& f) {
  const std::vector<SimulatedSeries>& joints = f.simulated.joints;
  std::vector<std::size_t> out(joints.size());
  for (std::size_t j = 0; j < out.size(); ++j) out[j] = j;
  std::ranges::stable_sort(out, {}, [&](std::size_t j) { return joints[j].extended_follows; });
  std::ranges::stable_sort(out, {}, [&](std::size_t j) {
    return std::ranges::find(f.causes, joints[j].joint, &Cause::where) - f.causes.begin();
  });
  return out;
}

std::string follows_cell(const SimulatedMotion& m, double t) {
  return t > 0.0 ? followed(m, t) : "less than " + in_seconds(m.horizons.front().horizon);
}

std::string follows_table(const Finding& f) {
  const SimulatedMotion& m = f.simulated;
  const bool one = f.causes.empty();
  std::vector<std::vector<std::string>> rows;
  for (const SimulatedSeries& s : m.joints) {
    std::vector<std::string> row{
        escape(s.joint), in_thousandths(s.tolerance, s.unit) + (is_of_noise(s) ? " (noise)" : ""),
        follows_cell(m, s.base_follows)};
    if (!one) row.push_back("<b>" + follows_cell(m, s.extended_follows) + "</b>");
    row.push_back(in_thousandths(s.base_rmse, s.unit));
    if (!one) row.push_back("<b>" + in_thousandths(s.extended_rmse, s.unit) + "</b>");
    rows.push_back(row);
  }
  const std::string error = ", error in windows of " + in_seconds(m.window);
  std::vector<std::string> titles{"joint", "tolerance", "base model follows for"};
  if (!one) titles.push_back("extended");
  titles.push_back("base model" + error);
  if (!one) titles.push_back("extended");
  return html_table(titles, rows, {"", "n", "n", "n", "n", "n"});
}

std::string pictures(const Finding& f, const std::vector<std::size_t>& open,
                     const std::vector<std::size_t>& folded) {
  const bool one = f.causes.empty();
  const auto figure = [&](const std::string& title, const std::string& joint) {
    Data data{{"joint", joint}};
    if (one) data.emplace_back("one", "");
    return "<figure><figcaption>" + title + "</figcaption>" + drawing("follows", data) +
           "</figure>\n";
  };
  const auto of_joint = [&](std::size_t j) {
    return figure(escape(f.simulated.joints[j].joint) + " <small>error over horizon</small>",
                  std::to_string(j));
  };
  std::string out = "<p class='faint'><span class='key nominal'></span>base model" +
                    std::string(one ? "" : "<span class='key fitted'></span>extended model") +
                    "<span class='key bound'></span>tolerance</p>\n<div class='evidence'>\n";
  if (f.simulated.joints.size() > 1)
    out += figure("all joints <small>largest error over its tolerance</small>", "all");
  for (const std::size_t j : open) out += of_joint(j);
  out += "</div>\n";
  if (folded.empty()) return out;
  out += "<details><summary>The other " +
         (folded.size() == 1 ? "joint" : std::to_string(folded.size()) + " joints") +
         "</summary>\n<div class='evidence'>\n";
  for (const std::size_t j : folded) out += of_joint(j);
  return out + "</div></details>\n";
}

/// Joints of causes whose motion the extension makes worse.
std::string farther(const Finding& f) {
  std::string out;
  for (const Cause& c : f.causes)
    for (const SimulatedSeries& s : f.simulated.joints)
      if (s.joint == c.where && s.extended_rmse > s.base_rmse &&
          out.find(s.joint) == std::string::npos)
        out += (out.empty() ? "" : ", ") + s.joint;
  return out;
}

}  // namespace

std::string follows_section(const Finding& f) {
  const SimulatedMotion& m = f.simulated;
  if (m.horizons.empty() && m.reason.empty()) return "";  // written before there was one
  std::string out = element("h2", "How long the simulation follows the robot");
  if (!m.reason.empty())
    return out + element("p", "No simulated motion is shown: " + m.reason + ".", "faint");
  out += element("p",
                 "Root mean square error of simulated positions on held-out data, in windows of "
                 "growing length. Each window begins in a state that is estimated from it; then "
                 "the " +
                     std::string(follows_commands(f) ? "commands drive" : "measured torque alone drives") +
                     " the simulation.",
                 "faint");
  const std::vector<std::size_t> order = by_interest(f);
  const auto middle = order.begin() + static_cast<long>(std::min(kOpen, order.size()));
  std::vector<std::size_t> open(order.begin(), middle), folded(middle, order.end());
  std::ranges::sort(open);
  std::ranges::sort(folded);
  out += pictures(f, open, folded) + follows_table(f);
  if (const std::string apart = apart_sentence(f); !apart.empty())
    out += element("p", apart + " There the error exceeds the joint's own motion.", "warning");
  const std::vector<ShownSeries> all = shown(m.joints);
  if (std::ranges::any_of(all, &ShownSeries::measured))
    out +=
        element("h3", "Motion in windows of " + in_seconds(m.window)) +
        element("p", "The windows are spread over the recording and drawn side by side.", "faint") +
        open_and_folded("simulated", all, open, folded, "position", names_of(f));
  if (const std::string joints = farther(f); !joints.empty())
    out += element("p",
                   "The extended model's torque fits better, but its motion of " + joints +
                       " does not: take its parameters there with care (of a hidden motor, torque "
                       "alone shows a ratio).",
                   "warning");
  return out;
}

}  // namespace diffnea::report
