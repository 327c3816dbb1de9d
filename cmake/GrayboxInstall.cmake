# Installs the libraries, headers and the find_package(graybox) configuration: one export for each
# component, so that who asks for solvers needs no packages of the diagnosis.
set(components problems solvers distributed)
set(header_folders problems solvers)
if(GRAYBOX_WITH_DIAGNOSIS)
  list(APPEND components diagnosis)
  list(APPEND header_folders diagnosis)
endif()
foreach(component IN LISTS components)
  get_property(libraries GLOBAL PROPERTY GRAYBOX_LIBRARIES_${component})
  if(libraries)
    install(TARGETS ${libraries} EXPORT graybox-${component}-targets
      ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
      LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
    install(EXPORT graybox-${component}-targets NAMESPACE graybox::
      DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/graybox)
  endif()
endforeach()
foreach(folder IN LISTS header_folders)
  install(CODE "
    set(source \"${CMAKE_SOURCE_DIR}\")
    set(folder \"${folder}\")
    set(destination \"\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_INCLUDEDIR}/graybox\")
    include(\"${CMAKE_SOURCE_DIR}/cmake/install_headers.cmake\")")
endforeach()
install(DIRECTORY ${CMAKE_SOURCE_DIR}/problems/robot/
  DESTINATION ${CMAKE_INSTALL_DATADIR}/graybox/robot COMPONENT program OPTIONAL)
configure_package_config_file(${CMAKE_SOURCE_DIR}/cmake/graybox-config.cmake.in
  ${CMAKE_BINARY_DIR}/graybox-config.cmake
  INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/graybox)
write_basic_package_version_file(${CMAKE_BINARY_DIR}/graybox-config-version.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/graybox-config.cmake
  ${CMAKE_BINARY_DIR}/graybox-config-version.cmake
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/graybox)
