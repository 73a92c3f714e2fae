#include <algorithm>
#include <cmath>

#include <diffnea/report/compare_text.hpp>

#include "core/c_numbers.hpp"
#include "report/format.hpp"

namespace diffnea {
namespace {

using namespace report;

std::string changes_table(const std::vector<Change>& changes) {
  std::vector<std::vector<std::string>> rows;
  for (const Change& c : changes) {
    if (!c.significant) continue;
    std::string name = c.name;
    if (width(name) > 60) {
      name.resize(57);
      while (!name.empty() && (static_cast<unsigned char>(name.back()) & 0x80)) name.pop_back();
      name += "...";
    }
    char z[32];
    detail::print(z, sizeof z, "%+.1f", c.z);
    rows.push_back({name, number(c.before), number(c.after),
                    value_and_std(c.after - c.before, c.std), unit(c.unit), z,
                    c.p < 1e-4 ? "< 0.0001" : number(c.p, 2)});
  }
  return table({"", "first", "second", "difference", "<unit", "z", "p"}, rows);
}

std::string list(const char* title, const std::vector<std::string>& names) {
  if (names.empty()) return "";
  std::string out = title;
  for (const std::string& name : names) out += (out.back() == ':' ? " " : ", ") + name;
  return out + "\n";
}

constexpr double kMuchMore = 2.0;   // times what the other fit leaves
constexpr double kMuchWider = 3.0;  // times the other's standard errors

/// Where one fit holds much worse than the other, and what that does to the comparison.
std::string unlike(const Comparison& c) {
  std::string out;
  for (const LeftOver& left : c.left_over) {
    const bool second = left.after > left.before;
    const double less = second ? left.before : left.after;
    const double more = second ? left.after : left.before;
    if (!(more > kMuchMore * less)) continue;
    out += left.joint + ": the " + (second ? "second" : "first") + " fit leaves " +
           number(more, 3) + " " + unit(left.unit) + " of its recording, the other " +
           number(less, 3) + "\n";
  }
  if (!out.empty())
    out =
        "\none fit holds much worse than the other: its model lacks something, or its recording "
        "is noisier, faster or of a wider band\n" +
        out;
  const bool wider = c.std_ratio > kMuchWider;
  if (wider || c.std_ratio < 1.0 / kMuchWider)
    out += std::string("the standard errors of the ") + (wider ? "second" : "first") + " are " +
           number(wider ? c.std_ratio : 1.0 / c.std_ratio, 2) +
           " times the other's (median): changes that are smaller are hidden\n";
  return out.empty() ? out : out + "\n";
}

}  // namespace

std::string compare_text(const Comparison& c) {
  const auto significant = [](const std::vector<Change>& list) {
    return static_cast<std::size_t>(std::ranges::count_if(list, &Change::significant));
  };
  const std::vector<Change>& main = c.base_parameters.empty() ? c.parameters : c.base_parameters;
  const std::string compared =
      c.base_parameters.empty()
          ? counted(main.size(), "parameter", "parameters")
          : counted(main.size(), "combination of parameters", "combinations of parameters");
  const std::size_t changed = significant(main);
  std::vector<Change> others;  // single parameters that are not in the table of combinations
  for (const Change& p : c.parameters)
    if (std::ranges::none_of(main, [&](const Change& b) { return b.name == p.name; }))
      others.push_back(p);
  std::string out;
  if (main.empty())
    out += "nothing to compare: the fits share nothing that both see\n";
  else if (changed == 0)
    out += (significant(others) > 0 ? "" : "nothing changed: ") + compared +
           " compared, no difference beyond its uncertainty\n" + "largest: " + main.front().name +
           ", z = " + number(main.front().z, 2) + "\n";
  else
    out += std::to_string(changed) + " of " + compared +
           " changed by more than the uncertainty explains\n" + changes_table(main);
  if (significant(others) > 0)
    out +=
        "\nchanged by more than the uncertainty explains, of parameters that both fits see by "
        "themselves\n" +
        changes_table(others);
  if (c.not_comparable > 0)
    out += counted(static_cast<std::size_t>(c.not_comparable), "combination", "combinations") +
           " of the first fit cannot be seen in the second\n";
  out += list("only in the first:", c.only_before);
  out += list("only in the second:", c.only_after);
  return out + unlike(c) +
         "p is the chance of such a difference without a change, adjusted for the number of "
         "comparisons "
         "(Holm)\n";
}

}  // namespace diffnea
