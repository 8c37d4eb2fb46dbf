#pragma once

#include <cstdint>
#include <cstring>
#include <map>
#include <string>
#include <vector>

namespace taclink::testing {

struct NpyData {
  std::string type;  ///< as NumPy names it: "<f8"
  std::vector<uint64_t> shape;
  std::string bytes;

  template <typename T>
  std::vector<T> Values() const {
    std::vector<T> values(bytes.size() / sizeof(T));
    std::memcpy(values.data(), bytes.data(), values.size() * sizeof(T));
    return values;
  }
};

/// The arrays of a .npz file, by name without ".npy". It goes from local header to local header, fails the
/// test where something is not as NumPy writes it, and knows no zip64.
std::map<std::string, NpyData> ReadNpz(const std::string& path);

/// Runs Python's own zip reader over the file; "": every member is intact, and what it says otherwise.
std::string PythonZipTest(const std::string& path);

}  // namespace taclink::testing
