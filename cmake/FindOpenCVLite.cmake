# OpenCV's own config file is only in Debian's umbrella package (260 MB); two modules are all that is used.
find_path(OpenCVLite_INCLUDE_DIR opencv2/core.hpp PATH_SUFFIXES opencv4)
find_library(OpenCVLite_core_LIBRARY opencv_core)
find_library(OpenCVLite_imgproc_LIBRARY opencv_imgproc)

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(
  OpenCVLite REQUIRED_VARS OpenCVLite_core_LIBRARY OpenCVLite_imgproc_LIBRARY OpenCVLite_INCLUDE_DIR)

if(OpenCVLite_FOUND AND NOT TARGET OpenCV::core)
  foreach(module core imgproc)
    add_library(OpenCV::${module} UNKNOWN IMPORTED)
    set_target_properties(OpenCV::${module} PROPERTIES
      IMPORTED_LOCATION "${OpenCVLite_${module}_LIBRARY}"
      INTERFACE_INCLUDE_DIRECTORIES "${OpenCVLite_INCLUDE_DIR}")
  endforeach()
  target_link_libraries(OpenCV::imgproc INTERFACE OpenCV::core)
endif()
