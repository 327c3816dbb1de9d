# CPack: a Debian package of the program (scripts/package). It holds what has the component `program`:
# the command, the process that reads foreign files, the robot's data, and completion for shells. Where
# the Python module is built, it is in the package, too: python3 and NumPy are recommended, not needed.
# Which libraries it needs dpkg-shlibdeps tells.
set(package_licence "${CMAKE_BINARY_DIR}/package/copyright")
file(READ ${CMAKE_SOURCE_DIR}/LICENSE licence)
set(combined "")
if(GRAYBOX_WITH_CHOLMOD)
  set(combined "This program is linked with SuiteSparse CHOLMOD, parts of which are under the GNU General
Public License, version 2 or later. As a whole the program is distributed under that licence, which is
in /usr/share/common-licenses/GPL-2. The source of graybox itself is under the following one.

")
endif()
file(WRITE ${package_licence} "${combined}${licence}")
install(FILES ${package_licence} DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/graybox COMPONENT program)
install(FILES ${CMAKE_SOURCE_DIR}/CHANGELOG.md ${CMAKE_SOURCE_DIR}/CITATION.cff
  DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/graybox COMPONENT program)
install(DIRECTORY ${CMAKE_SOURCE_DIR}/docs/
  DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/graybox COMPONENT program)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME graybox)
set(CPACK_PACKAGE_VENDOR "graybox")
set(CPACK_PACKAGE_CONTACT "The graybox authors <graybox@example.invalid>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "${PROJECT_DESCRIPTION}")
set(CPACK_PACKAGE_DESCRIPTION "graybox tells which experiments to run, and which physics a model of a machine
leaves out. Each answer comes with a proof or an error bar.")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_ALL program)
if(TARGET graybox_python)
  list(APPEND CPACK_COMPONENTS_ALL python)
  set(CPACK_DEBIAN_PACKAGE_RECOMMENDS "python3 (>= 3.${Python_VERSION_MINOR}), python3-numpy")
  set(CPACK_DEBIAN_PACKAGE_SUGGESTS "python3-matplotlib")
endif()
set(CPACK_COMPONENTS_GROUPING ALL_COMPONENTS_IN_ONE)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_NAME graybox)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS OFF)
include(CPack)
