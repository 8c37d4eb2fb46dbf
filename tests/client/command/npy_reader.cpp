#include "tests/client/command/npy_reader.h"

#include <gtest/gtest.h>

#include <regex>
#include <sstream>

#include "tests/client/command/log_content.h"

namespace taclink::testing {
namespace {

template <typename T>
T NumberAt(const std::string& bytes, size_t offset) {
  T value = 0;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

NpyData ParseNpy(const std::string& file) {
  NpyData out;
  EXPECT_EQ(file.substr(0, 6), "\x93NUMPY");
  EXPECT_EQ(NumberAt<uint16_t>(file, 6), 1) << "version 1.0";
  const size_t data = 10 + size_t{NumberAt<uint16_t>(file, 8)};
  EXPECT_EQ(data % 64, 0u);
  const std::string header = file.substr(10, data - 10);
  EXPECT_EQ(header.back(), '\n');
  const std::regex form(
      R"(\{'descr': '([^']+)', 'fortran_order': False, 'shape': \(((?:\d+, )*\d+,?)\), \} *\n)");
  std::smatch match;
  EXPECT_TRUE(std::regex_match(header, match, form)) << header;
  out.type = match[1];
  std::istringstream shape(match[2]);
  for (std::string size; std::getline(shape, size, ',');) out.shape.push_back(std::stoull(size));
  out.bytes = file.substr(data);
  uint64_t bytes = std::stoull(out.type.substr(2));
  for (const uint64_t size : out.shape) bytes *= size;
  EXPECT_EQ(out.bytes.size(), bytes);
  return out;
}

}  // namespace

std::map<std::string, NpyData> ReadNpz(const std::string& path) {
  const std::string zip = FileText(path);
  std::map<std::string, NpyData> arrays;
  size_t at = 0;
  while (at + 30 <= zip.size() && NumberAt<uint32_t>(zip, at) == 0x04034B50) {
    EXPECT_EQ(NumberAt<uint16_t>(zip, at + 8), 0) << "stored";
    const size_t size = NumberAt<uint32_t>(zip, at + 22);
    EXPECT_EQ(NumberAt<uint32_t>(zip, at + 18), size);
    const size_t name_size = NumberAt<uint16_t>(zip, at + 26), extra_size = NumberAt<uint16_t>(zip, at + 28);
    const std::string name = zip.substr(at + 30, name_size);
    EXPECT_TRUE(name.ends_with(".npy")) << name;
    const size_t data = at + 30 + name_size + extra_size;
    arrays[name.substr(0, name.size() - 4)] = ParseNpy(zip.substr(data, size));
    at = data + size;
  }
  EXPECT_EQ(NumberAt<uint32_t>(zip, at), 0x02014B50u) << "the directory";
  return arrays;
}

std::string PythonZipTest(const std::string& path) {
  const Finished run = RunToEnd({"/usr/bin/env", "python3", "-c",
                                 "import sys, zipfile\n"
                                 "bad = zipfile.ZipFile(sys.argv[1]).testzip()\n"
                                 "print(bad or '', end='')",
                                 path});
  return run.exit_code == 0 ? run.out : "failed: " + run.err;
}

}  // namespace taclink::testing
