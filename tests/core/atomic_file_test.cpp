#include <csignal>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <string>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_exception.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/atomic_file.hpp>
#include <diffnea/core/error.hpp>
#include <diffnea/core/text_file.hpp>

#include "support/ended_process.hpp"
#include "support/temporary_folder.hpp"

namespace atomic_file_test {

using namespace diffnea;
using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::MessageMatches;
using diffnea::test::ended_process;

namespace {

namespace fs = std::filesystem;

std::string content(const fs::path& path) {
  std::ostringstream out;
  out << std::ifstream(path, std::ios::binary).rdbuf();
  return out.str();
}

void put(const fs::path& path, const std::string& text) { std::ofstream(path) << text; }

std::set<std::string> names(const fs::path& folder) {
  std::set<std::string> out;
  for (const auto& entry : fs::directory_iterator(folder))
    out.insert(entry.path().filename().string());
  return out;
}

}  // namespace

TEST_CASE("atomic file: the old content stays until all of the new is there", "[core]") {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path() / "a.txt";
  put(path, "old");
  {
    AtomicFile file(path);
    file.write("ne");
    CHECK(content(path) == "old");
    CHECK(names(folder.path()).size() == 2);
    file.write("w");
    file.commit();
    CHECK(content(path) == "new");
  }
  CHECK(names(folder.path()) == std::set<std::string>{"a.txt"});
  {
    AtomicFile file(path);
    file.write("not to be");
  }
  CHECK(content(path) == "new");
  CHECK(names(folder.path()) == std::set<std::string>{"a.txt"});
}

TEST_CASE("atomic file: what a killed process left goes, what a living one writes stays",
          "[core]") {
  const test::TemporaryFolder folder;
  const std::string dead = std::to_string(ended_process()), alive = std::to_string(::getppid());
  const std::set<std::string> kept{".a.txt." + alive + ".0.tmp", ".b.txt." + dead + ".0.tmp",
                                   ".a.txt.mine.tmp", ".a.txt." + dead + "tmp"};
  for (const std::string& name : kept) put(folder.path() / name, "kept");
  put(folder.path() / (".a.txt." + dead + ".0.tmp"), "half");
  put(folder.path() / (".a.txt." + dead + ".17.tmp"), "half");
  write_file_atomically(folder.path() / "a.txt", "whole");
  std::set<std::string> expected = kept;
  expected.insert("a.txt");
  CHECK(names(folder.path()) == expected);
}

TEST_CASE("atomic file: permissions and links are those of the file that is replaced", "[core]") {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path() / "real.txt", link = folder.path() / "link.txt";
  put(path, "old");
  fs::permissions(path, fs::perms::owner_read | fs::perms::owner_write);
  fs::create_symlink("real.txt", link);
  write_file_atomically(link, "new");
  CHECK(fs::is_symlink(link));
  CHECK(content(path) == "new");
  CHECK(fs::status(path).permissions() == (fs::perms::owner_read | fs::perms::owner_write));
}

TEST_CASE("atomic file: a device is written into, and stays a device", "[core]") {
  write_file_atomically("/dev/null", "nothing");
  CHECK(fs::is_character_file("/dev/null"));
  REQUIRE(fs::is_character_file("/dev/full"));
  CHECK_THROWS_MATCHES(write_file_atomically("/dev/full", "more than there is room for"), FileError,
                       MessageMatches(ContainsSubstring("/dev/full: cannot be written") &&
                                      ContainsSubstring("No space left")));
  CHECK(fs::is_character_file("/dev/full"));
}

TEST_CASE("atomic file: a disk that is full leaves the old file, and nothing else", "[core]") {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path() / "a.txt";
  put(path, "old");
  // In a process of its own, whose files may have 1000 bytes.
  const pid_t child = ::fork();
  if (child == 0) {
    ::signal(SIGXFSZ, SIG_IGN);
    const struct rlimit little = {1000, 1000};
    ::setrlimit(RLIMIT_FSIZE, &little);
    int status = 1;
    try {
      write_file_atomically(path, std::string(5000, 'x'));
    } catch (const FileError& error) {
      const std::string text = error.what();
      status = text.starts_with(path.string() + ": cannot be written (") ? 0 : 2;
    }
    ::_exit(status);
  }
  int status = -1;
  ::waitpid(child, &status, 0);
  CHECK(status == 0);
  CHECK(content(path) == "old");
  CHECK(names(folder.path()) == std::set<std::string>{"a.txt"});
}

TEST_CASE("atomic file: a folder that is not there is named with the file", "[core]") {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path() / "nowhere" / "a.txt";
  CHECK_THROWS_MATCHES(AtomicFile(path), FileError,
                       MessageMatches(ContainsSubstring(path.string() + ": cannot be written (")));
  CHECK_THROWS_MATCHES(write_file_atomically(folder.path(), "x"), FileError,
                       MessageMatches(ContainsSubstring("directory")));
}

}  // namespace atomic_file_test
