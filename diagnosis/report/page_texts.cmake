# page_texts.cpp in the build tree: the template, style sheet and script of a page, and dygraphs from
# Debian (libjs-dygraphs), as string literals. Included by diagnosis/CMakeLists.txt.
set(folder ${CMAKE_CURRENT_LIST_DIR})
find_path(GRAYBOX_DYGRAPHS dygraph.min.js PATHS /usr/share/javascript/dygraphs REQUIRED
  DOC "folder of dygraph.min.js (Debian: libjs-dygraphs)")
find_path(GRAYBOX_MUSTACHE kainjow/mustache.hpp REQUIRED
  DOC "folder of kainjow/mustache.hpp (Debian: libkainjow-mustache-dev)")
set(names kTemplate kStyle kScript kCompare kPoses kDygraphs kDygraphsStyle kSynchronizer kLicences)
set(files ${folder}/page.mustache ${folder}/page.css ${folder}/page.js ${folder}/compare.js ${folder}/poses.js
  ${GRAYBOX_DYGRAPHS}/dygraph.min.js
  ${GRAYBOX_DYGRAPHS}/dygraph.min.css ${GRAYBOX_DYGRAPHS}/src-es5/extras/synchronizer.js
  ${folder}/licences.txt)
set(text "// Written by CMake from page.mustache and its like.\n#include \"diagnosis/report/page_texts.hpp\"\n\n")
string(APPEND text "namespace graybox::page_texts {\n\n")
foreach(name file IN ZIP_LISTS names files)
  file(READ "${file}" content)
  # What refers to files beside, for debuggers: it would be a request.
  string(REGEX REPLACE "//# sourceMappingURL=[^\n]*" "" content "${content}")
  string(REGEX REPLACE "/\\*# sourceMappingURL=[^*]*\\*/" "" content "${content}")
  string(APPEND text "const char* const ${name} = R\"GRAYBOX(${content})GRAYBOX\";\n")
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${file}")
endforeach()
string(APPEND text "\n}  // namespace graybox::page_texts\n")
set(written "")
if(EXISTS ${CMAKE_CURRENT_BINARY_DIR}/page_texts.cpp)
  file(READ ${CMAKE_CURRENT_BINARY_DIR}/page_texts.cpp written)
endif()
if(NOT written STREQUAL text)
  file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/page_texts.cpp "${text}")
endif()
