#include <algorithm>
#include <cmath>
#include <cstdio>

#include <diffnea/report/compare_text.hpp>

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
    std::snprintf(z, sizeof z, "%+.1f", c.z);
    rows.push_back({name, number(c.before), number(c.after),
                    value_and_std(c.after - c.before, c.std), unit(c.unit), z,
                    c.p < 1e-4 ? "< 0.0001" : number(c.p, 2)});
  }
  return table({"", "first", "second", "difference", "<unit", "z", "p"}, rows);
}

std::string count(std::size_t n, const char* what) {
  return std::to_string(n) + " " + what + (n == 1 ? "" : "s");
}

std::string list(const char* title, const std::vector<std::string>& names) {
  if (names.empty()) return "";
  std::string out = title;
  for (const std::string& name : names) out += (out.back() == ':' ? " " : ", ") + name;
  return out + "\n";
}

}  // namespace

std::string compare_text(const Comparison& c) {
  const auto significant = [](const std::vector<Change>& list) {
    return static_cast<std::size_t>(std::ranges::count_if(list, &Change::significant));
  };
  const std::size_t changed = significant(c.base_parameters);
  std::string out;
  if (c.base_parameters.empty())
    out += "nothing to compare: the fits share no combination of parameters that both see\n";
  else if (changed == 0)
    out += "nothing changed: " + count(c.base_parameters.size(), "combination") +
           " of parameters compared, no difference beyond its uncertainty\n";
  else
    out += std::to_string(changed) + " of " + count(c.base_parameters.size(), "combination") +
           " of parameters changed by more than their uncertainty explains\n" +
           changes_table(c.base_parameters);
  std::vector<Change> others;  // single parameters that are not in the table above
  for (const Change& p : c.parameters)
    if (std::ranges::none_of(c.base_parameters, [&](const Change& b) { return b.name == p.name; }))
      others.push_back(p);
  if (significant(others) > 0)
    out += "\nparameters that both fits see by themselves\n" + changes_table(others);
  if (!c.base_parameters.empty()) {
    const Change& first = c.base_parameters.front();
    if (changed == 0) out += "largest: " + first.name + ", z = " + number(first.z, 2) + "\n";
  }
  if (c.not_comparable > 0)
    out += count(static_cast<std::size_t>(c.not_comparable), "combination") +
           " of the first fit cannot be seen in the second\n";
  out += list("only in the first:", c.only_before);
  out += list("only in the second:", c.only_after);
  return out +
         "p is the chance of such a difference without a change, adjusted for the number of "
         "comparisons "
         "(Holm)\n";
}

}  // namespace diffnea
