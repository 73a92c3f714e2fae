#pragma once
/// What a header of a recording means: for each column its channel, joint and factor to SI.
/// Internal.

#include <string>
#include <string_view>
#include <vector>

#include <diffnea/recording/csv.hpp>

#include "recording/column_units.hpp"

namespace diffnea::detail {

struct Column {
  Channel channel = Channel::kExtra;
  int index = 0;  ///< joint, column of the series that has axes, or number of the extra channel
  Conversion conversion;  ///< to SI
  std::string name;       ///< name in the header, or as mapped
};

struct Columns {
  std::vector<Column> columns;
  std::vector<std::string> joint_names;  ///< in the order of the q_ columns
  std::vector<std::string> extra_names;
  std::vector<bool> has_tau;  ///< per joint: there is a column
  std::vector<bool> passive;  ///< per joint: its torque is known to be zero
  std::vector<std::string> notes;

  long find(Channel channel) const;  ///< number of its first column, −1: there is none
  bool has(Channel channel) const { return find(channel) >= 0; }
};

/// @param where    file name, for messages
/// @param options  of its joints, where the model is known: slides have no angles, hinges no
///                 lengths; other joints are left out if all of the model's are there
/// @throws DataError `file:1:column: …`
Columns parse_header(std::string_view line, const std::string& where, const ReadOptions& options);

/// No measured value of this channel is larger, in SI; infinite: anything goes.
double largest_credible(Channel channel);

/// A header has no way to say commas, quotes, line ends and spaces about a name, nor brackets in a
/// joint's, which hold units. @throws DataError that begins with `what`
void require_plain_name(const std::string& what, const std::string& name, bool of_joint);

}  // namespace diffnea::detail
