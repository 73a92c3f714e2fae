#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/fields.hpp>
#include <diffnea/diagnose/finding.hpp>
#include <diffnea/runs/schemas.hpp>

namespace diffnea::fields_test {
namespace {

using Catch::Matchers::ContainsSubstring;

struct Whole {
  int one = 0;
  double other = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Whole", "All of it.");
    list.field("one", &Whole::one, "First.");
    list.derived("sum", [](const Whole& x) { return x.one + x.other; }, "Of both.");
    list.in_memory("other", &Whole::other, "Second.");
  }
};

/// The same with a member that its list does not name.
struct Partly {
  int one = 0;
  double other = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Partly", "A part of it.");
    list.field("one", &Partly::one, "First.");
  }
};

struct Outside {
  int one = 0;
};

// Assertions of visit_fields().
static_assert(detail::listed_fields<Whole>() == detail::member_count<Whole>());
static_assert(detail::listed_fields<Partly>() == 1 && detail::member_count<Partly>() == 2);
static_assert(Described<Whole> && !Described<Outside>);
static_assert(NamedEnum<Verdict> && !NamedEnum<RunFile>);

}  // namespace

TEST_CASE("fields: an enumeration's names go both ways, others are refused", "[core]") {
  for (const NamedValue<Verdict>& each : EnumNames<Verdict>::list)
    CHECK(value_of<Verdict>(name_of(each.value), "here") == each.value);
  CHECK_THROWS_WITH(value_of<Verdict>("MAYBE", "here"),
                    "here: got 'MAYBE'; choices: NAMED, CLASS, UNKNOWN, NONE, NOT_IDENTIFIABLE");
}

TEST_CASE("schemas: every file has one, with units; others are refused by name", "[io]") {
  for (const std::string& name : schema_names())
    CHECK_THAT(json_schema(name), ContainsSubstring("\"diffnea/" + name + "/1\""));
  const std::string diagnose = json_schema("diagnose");
  CHECK_THAT(diagnose,
             ContainsSubstring("\"torque_share\"") && ContainsSubstring("\"unit\": \"s\""));
  CHECK_THAT(diagnose, !ContainsSubstring(":class:") && !ContainsSubstring("data_report"));
  CHECK_THROWS_WITH(json_schema("nothing"), ContainsSubstring("got 'nothing'; choices: audit"));
}

}  // namespace diffnea::fields_test
