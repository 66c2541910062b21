"""The camera: an Orbbec Astra through OpenNI2, or another source of pictures behind the same port."""
